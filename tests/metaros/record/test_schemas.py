"""Schemas of types that this process has never seen: asked from the node of another process that publishes them."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from rosbags.highlevel import AnyReader

import metaros
from metaros.idl import default_catalogue, type_hash
from metaros.record import Recorder, open_bag
from metaros.record.schemas import find_schema, known_schema
from tests.support.processes.processes import started
from tests.support.waiting import wait_until

PART = "# how warm\nfloat32[<=3] values [1.5]\nstring<=8 label\n"
WHOLE = "uint8 FULL=7\nheat_pkg/Part[2] parts\nstd_msgs/Header header\nbyte[] rest\nbool on\n"
OVEN = f"""
import sys, threading
import metaros
from metaros.idl import default_catalogue, message_class, parse_definition
for name, text in (("heat_pkg/msg/Part", {PART!r}), ("heat_pkg/msg/Oven", {WHOLE!r})):
    default_catalogue().add(parse_definition(text, name))
Oven, Part = message_class("heat_pkg/msg/Oven"), message_class("heat_pkg/msg/Part")
with metaros.Context(connect=sys.argv[1]) as context, metaros.Node("oven", context=context) as node:
    publisher = node.create_publisher(Oven, "/oven", 10)
    count = iter(range(10**9))
    @node.timer(0.02)
    def tick():
        publisher.publish(Oven(parts=[Part(values=[next(count)], label="a"), Part(values=[1.0, 2.0], label="b")]))
    threading.Thread(target=lambda: (sys.stdin.read(), executor.shutdown()), daemon=True).start()
    executor = metaros.SingleThreadedExecutor()
    executor.add_node(node)
    executor.spin()
"""


def test_the_catalogue_knows_only_the_same_hash() -> None:
    name = "std_msgs/msg/String"
    assert known_schema(name, type_hash(name)) == "string data\n"
    assert known_schema(name, "TypeHashNotSupported") == "string data\n"
    assert known_schema(name, "RIHS01_" + "0" * 64) == ""
    assert known_schema("nobody/msg/Knows", "RIHS01_" + "0" * 64) == ""


def test_nobody_to_ask(contexts: tuple) -> None:
    with metaros.Node("asker", context=contexts[0], enable_rosout=False, enable_parameters=False) as node:
        text, reason = find_schema(node, "nobody/msg/Knows", "RIHS01_" + "0" * 64)
    assert text == ""
    assert "nobody/msg/Knows" in reason
    assert "\n" not in reason


def test_a_type_of_another_process(zenoh_router: str, tmp_path: Path) -> None:
    reported: list[str] = []
    with started([sys.executable, "-c", OVEN, zenoh_router], stdin=subprocess.PIPE, stdout=None, stderr=None):
        with metaros.Context(connect=zenoh_router) as context:
            with Recorder(context, tmp_path / "run", topics=["/oven"], notice=reported.append) as recorder:
                wait_until(lambda: recorder.report().written >= 10)
    assert reported == []
    assert "heat_pkg/msg/Oven" not in default_catalogue()
    (topic,) = open_bag(tmp_path / "run").topics
    assert "MSG: heat_pkg/Part\nfloat32[<=3] values [1.5]\n" in topic.schema
    messages = [message.decode() for message in open_bag(tmp_path / "run").messages()]
    assert [m.parts[1].label for m in messages] == ["b"] * len(messages)
    with AnyReader([tmp_path / "run"]) as reader:
        connection, _stamp, raw = next(reader.messages())
        assert reader.deserialize(raw, connection.msgtype).parts[0].label == "a"
