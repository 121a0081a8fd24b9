"""Parameters, type descriptions and logger levels as a plain eclipse-zenoh peer sees them, written from the wire sheet.

Nothing here encodes or decodes with Meta-ROS: keys, attachments and CDR are spelled out, or read by rosbags.
"""

from __future__ import annotations

import json
import struct
import threading
from collections.abc import Iterator
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import pytest
import xxhash
import zenoh
from rosbags.typesys import Stores, get_typestore

import metaros
from tests.support.waiting import wait_until

HASHES = json.loads((Path(__file__).parents[1] / "data" / "ros2_rihs01.json").read_text())["distros"]["jazzy"]["hashes"]
STORE = get_typestore(Stores.ROS2_JAZZY)
DEPTH_1000 = "::,1000:,:,:,,"
GID = bytes(range(16))
SERVICES = (
    "DescribeParameters",
    "GetParameterTypes",
    "GetParameters",
    "ListParameters",
    "SetParameters",
    "SetParametersAtomically",
)


def snake(name: str) -> str:
    return "".join(f"_{letter.lower()}" if letter.isupper() else letter for letter in name)[1:]


def service_key(name: str, package: str = "rcl_interfaces") -> str:
    """`<domain>/<node>/<service>/<dds type>/<hash of the service type>`."""
    return f"0/ns/robot/{snake(name)}/{package}::srv::dds_::{name}_/{HASHES[f'{package}/srv/{name}']}"


class Cdr:
    """A CDR body, written by hand."""

    def __init__(self) -> None:
        self.data = b""

    def put(self, code: str, *values: Any) -> Cdr:
        """Numbers of one kind, aligned."""
        self.data += b"\0" * (-len(self.data) % struct.calcsize(code))
        self.data += struct.pack(f"<{len(values)}{code}", *values)
        return self

    def text(self, *texts: str) -> Cdr:
        """Strings, each with its length and its zero."""
        for text in texts:
            data = text.encode() + b"\0"
            self.put("I", len(data)).data += data
        return self

    def texts(self, *texts: str) -> Cdr:
        """A sequence of strings."""
        return self.put("I", len(texts)).text(*texts)

    def value(self, kind: int, integer: int = 0, double: float = 0.0) -> Cdr:
        """A ParameterValue with a number."""
        return self.put("B", kind, 0).put("q", integer).put("d", double).text("").put("I", 0, 0, 0, 0, 0)


def one_double(name: str, value: float) -> bytes:
    """A sequence of one Parameter."""
    return Cdr().put("I", 1).text(name).value(3, double=value).data


@pytest.fixture
def plain(zenoh_router: str) -> Iterator[zenoh.Session]:
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", f'["{zenoh_router}"]')
    config.insert_json5("scouting/multicast/enabled", "false")
    with zenoh.open(config) as session:
        yield session


@pytest.fixture
def robot(zenoh_router: str) -> Iterator[metaros.Node]:
    with (
        metaros.Context(domain_id=0, connect=zenoh_router) as context,
        metaros.Node("robot", namespace="/ns", context=context, enable_logger_service=True) as node,
    ):
        node.declare_parameter("speed", 0.5, minimum=0.0, maximum=1.0, description="m/s")
        node.declare_parameter("motor.id", 7, read_only=True)
        executor = metaros.SingleThreadedExecutor()
        executor.add_node(node)
        thread = threading.Thread(target=executor.spin)
        thread.start()
        yield node
        executor.shutdown()
        thread.join()


class Asker:
    """Calls services as rmw_zenoh's client does."""

    def __init__(self, session: zenoh.Session) -> None:
        self.session, self.seq = session, 0

    def __call__(self, key: str, body: bytes) -> bytes:
        self.seq += 1
        replies: SimpleQueue[zenoh.Reply] = SimpleQueue()
        self.session.get(
            key,
            zenoh.handlers.Callback(replies.put, indirect=False),
            target=zenoh.QueryTarget.ALL_COMPLETE,
            consolidation=zenoh.ConsolidationMode.NONE,
            payload=b"\0\1\0\0" + body,
            attachment=struct.pack("<qqB", self.seq, 1, 16) + GID,
            timeout=60.0,
        )
        reply = replies.get(timeout=60).ok
        assert reply is not None
        assert str(reply.key_expr) == key
        assert reply.attachment is not None
        attachment = reply.attachment.to_bytes()
        assert (len(attachment), attachment[17:]) == (33, GID)
        assert struct.unpack_from("<qqB", attachment)[0] == self.seq
        payload = reply.payload.to_bytes()
        assert payload[:4] == b"\0\1\0\0"
        return payload[4:]


@pytest.fixture
def ask(plain: zenoh.Session, robot: metaros.Node) -> Asker:
    wait_until(lambda: any(plain.liveliness().get("@ros2_lv/0/*/*/*/SS/**")))
    return Asker(plain)


def tokens(session: zenoh.Session) -> list[list[str]]:
    replies = session.liveliness().get("@ros2_lv/0/**")
    return [str(reply.ok.key_expr).split("/") for reply in replies if reply.ok is not None]


def test_a_node_offers_what_every_ros2_node_offers_in_its_order(plain, robot):
    wait_until(lambda: len(tokens(plain)) >= 12)
    found = {int(parts[4]): parts for parts in tokens(plain)}
    assert found[0][5:] == ["NN", "%", "%ns", "robot"]
    assert found[1][5:10] == ["MP", "%", "%ns", "robot", "%rosout"]
    event = HASHES["rcl_interfaces/msg/ParameterEvent"]
    assert found[2][9:] == ["%parameter_events", "rcl_interfaces::msg::dds_::ParameterEvent_", event, DEPTH_1000]
    for eid, name in enumerate(SERVICES, 3):
        type_hash = HASHES[f"rcl_interfaces/srv/{name}"]
        dds = f"rcl_interfaces::srv::dds_::{name}_"
        assert found[eid][5:] == [
            "SS",
            "%",
            "%ns",
            "robot",
            f"%ns%robot%{snake(name)}",
            dds,
            type_hash,
            "::,1000:,:,:,,",
        ]
    assert found[9][9] == "%ns%robot%get_type_description"
    assert found[9][11:] == [HASHES["type_description_interfaces/srv/GetTypeDescription"], "::,10:,:,:,,"]
    assert [found[eid][9] for eid in (10, 11)] == ["%ns%robot%get_logger_levels", "%ns%robot%set_logger_levels"]
    assert [found[eid][11] for eid in (10, 11)] == [
        HASHES["rcl_interfaces/srv/GetLoggerLevels"],
        HASHES["rcl_interfaces/srv/SetLoggerLevels"],
    ]
    gid = xxhash.xxh3_128("/".join(found[2]).encode()).intdigest().to_bytes(16, "little")
    assert gid in {endpoint.gid for endpoint in robot.graph.tokens()}


def test_names_values_and_types_are_listed_byte_for_byte(ask):
    names = ask(service_key("ListParameters"), Cdr().texts().put("Q", 0).data)
    assert names == Cdr().texts("use_sim_time", "speed", "motor.id").texts("motor").data
    types = ask(service_key("GetParameterTypes"), Cdr().texts("speed", "motor.id", "none").data)
    assert types == Cdr().put("I", 3).put("B", 3, 2, 0).data
    values = ask(service_key("GetParameters"), Cdr().texts("speed", "motor.id", "none").data)
    assert values == Cdr().put("I", 3).value(3, double=0.5).value(2, integer=7).value(0).data


def test_a_set_is_obeyed_and_reported_to_all(plain, robot, ask):
    events: SimpleQueue[zenoh.Sample] = SimpleQueue()
    type_hash = HASHES["rcl_interfaces/msg/ParameterEvent"]
    key = f"0/parameter_events/rcl_interfaces::msg::dds_::ParameterEvent_/{type_hash}"
    plain.declare_subscriber(key, zenoh.handlers.Callback(events.put, indirect=False))

    def received() -> bool:
        done = ask(service_key("SetParameters"), one_double("speed", 0.25))
        assert done == Cdr().put("I", 1).put("B", 1).text("").data
        return not events.empty()

    wait_until(received)
    assert robot.parameters["speed"] == 0.25
    sample = events.get()
    event = STORE.deserialize_cdr(sample.payload.to_bytes(), "rcl_interfaces/msg/ParameterEvent")
    assert (event.node, event.new_parameters, event.deleted_parameters) == ("/ns/robot", [], [])
    changed = [(item.name, item.value.type, item.value.double_value) for item in event.changed_parameters]
    assert changed == [("speed", 3, 0.25)]
    assert sample.attachment is not None
    assert len(sample.attachment.to_bytes()) == 33


def test_a_set_is_refused_with_its_reason(robot, ask):
    refused = ask(service_key("SetParameters"), one_double("speed", 1.5))
    assert refused == Cdr().put("I", 1).put("B", 0).text("speed: 1.5 is not within 0.0..1.0").data
    refused = ask(service_key("SetParametersAtomically"), one_double("motor.id", 2.0))
    assert refused == Cdr().put("B", 0).text("motor.id: it is read-only").data
    integer = Cdr().put("I", 1).text("speed").value(2, integer=1).data
    refused = ask(service_key("SetParametersAtomically"), integer)
    assert refused == Cdr().put("B", 0).text("speed: wrong type: expected double, got integer").data
    assert robot.parameters.values() == {"use_sim_time": False, "speed": 0.5, "motor.id": 7}


def test_rules_are_described_byte_for_byte(ask):
    answer = ask(service_key("DescribeParameters"), Cdr().texts("speed", "none").data)
    wanted = Cdr().put("I", 2)
    wanted.text("speed").put("B", 3).text("m/s", "").put("B", 0, 0).put("I", 1).put("d", 0.0, 1.0, 0.0).put("I", 0)
    wanted.text("").put("B", 0).text("", "").put("B", 0, 0).put("I", 0, 0)
    assert answer == wanted.data


def test_types_are_described_for_peers_that_lack_them(ask):
    key = service_key("GetTypeDescription", "type_description_interfaces")
    type_hash = HASHES["std_msgs/msg/String"]
    answer = ask(key, Cdr().text("std_msgs/msg/String", type_hash).put("B", 1).data)
    wanted = Cdr().put("B", 1).text("").text("std_msgs/msg/String").put("I", 1).text("data")
    wanted.put("B", 17).put("Q", 0, 0).text("", "").put("I", 0)  # a string; no default; no other types
    wanted.put("I", 1).text("std_msgs/msg/String", "msg", "string data\n").put("I", 0)
    assert answer == wanted.data
    other = "RIHS01_" + "0" * 64
    answer = ask(key, Cdr().text("std_msgs/msg/String", other).put("B", 0).data)
    assert answer.startswith(Cdr().put("B", 0).text(f"std_msgs/msg/String is {type_hash} here, not {other}").data)


def test_the_loggers_level_is_read_and_set(robot, ask):
    answer = ask(service_key("GetLoggerLevels"), Cdr().texts("ns.robot", "other").data)
    assert answer == Cdr().put("I", 2).text("ns.robot").put("I", 20).text("other").put("I", 0).data
    wanted = Cdr().put("I", 3).text("ns.robot").put("I", 10).text("other").put("I", 10).text("ns.robot").put("I", 7)
    answer = ask(service_key("SetLoggerLevels"), wanted.data)
    refusals = Cdr().put("I", 3).put("B", 1).text("").put("B", 0).text("no logger 'other' here, only 'ns.robot'")
    assert answer == refusals.put("B", 0).text("7 is no level: one of 10, 20, 30, 40, 50").data
    assert robot.get_logger().level == 10
