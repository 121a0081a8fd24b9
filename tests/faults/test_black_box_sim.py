"""A simulated robot at full rate loses its link, breaks a wheel, and is saved afterwards: all of it is in the file.

What there is to be saved says a recorder that stands beside the agent on the robot.
"""

from __future__ import annotations

import json
import threading
from collections import defaultdict
from pathlib import Path

import pytest
from mcap.reader import make_reader

from metaros.cli.shared.gateway_http import GatewayClient
from metaros.interfaces.std_msgs.msg import String
from metaros.node import Context, Node
from metaros.record import Recorder, open_bag
from tests.support.processes.stack import Stack
from tests.support.servers.cutting_proxy import CuttingProxy
from tests.support.waiting import wait_until

pytestmark = pytest.mark.integration

CUT_S, MARGIN_S = 5.0, 1.0
SECOND = 1_000_000_000
TOPICS = {"/sim_1/odom", "/sim_1/scan", "/sim_1/imu", "/sim_1/camera/image/compressed"}
Seen = dict[str, dict[tuple[int, bytes], int]]  # by topic: sequence number and payload to log time


def seen(path: Path) -> Seen:
    """What a recording holds."""
    found: Seen = defaultdict(dict)
    for message in open_bag(path).messages():
        key = (message.sequence, bytes(message.data))
        assert key not in found[message.topic.name], f"{message.topic.name}: {message.sequence} is there twice"
        found[message.topic.name][key] = message.log_ns
    return found


def missing(truth: Seen, clip: Seen, start_ns: int, end_ns: int) -> tuple[int, set[tuple[str, int]]]:
    """How many messages came in that time, and those that are not in the clip, by topic and sequence number."""
    total, lacks = 0, set()
    for topic, messages in truth.items():
        wanted = {key for key, log_ns in messages.items() if start_ns <= log_ns <= end_ns}
        total += len(wanted)
        lacks |= {(topic, sequence) for sequence, _ in wanted - clip[topic].keys()}
    return total, lacks


def declared(path: Path) -> set[tuple[str, int]]:
    """What the clip says that never came to the agent: a starved machine's transport drops what need not arrive."""
    with path.open("rb") as file:
        accounts = [record.metadata for record in make_reader(file).iter_metadata() if record.name == "metaros.gaps"]
    return {
        (key.split(" ")[0], sequence)
        for key, text in accounts[0].items()
        for first, last in json.loads(text).get("lost", ())
        for sequence in range(first, last + 1)
    }


def test_every_full_rate_message_of_a_simulated_robot(tmp_path: Path) -> None:
    with Stack(tmp_path) as stack, CuttingProxy(stack.grpc_port) as proxy:
        stack.router()
        _, _, agent = stack.at_once(
            stack.gateway, stack.sim, lambda: stack.agent("sim_1", "--gateway", f"127.0.0.1:{proxy.port}")
        )
        wait_until(lambda: stack.online() == {"sim_1"})
        wait_until(lambda: set(stack.topics("sim_1")) >= TOPICS)
        endpoint = f"tcp/127.0.0.1:{stack.zenoh_port}"
        with (
            Context(connect=[endpoint], shared_memory="off") as context,
            Node("saboteur", context=context, enable_rosout=False) as node,
        ):
            clock, pause = context.clock, threading.Event().wait
            break_a_wheel = node.create_publisher(String, "/sim_1/base/fault", 10)
            wait_until(lambda: node.graph.endpoints("/sim_1/base/fault", "MS"))
            with Recorder(context, tmp_path / "truth.mcap", topics=["/sim_1/**"]):
                pause(MARGIN_S)
                start_ns = clock.wall_ns()
                proxy.cut_after(up=0)
                wait_until(lambda: not stack.online())
                pause(CUT_S / 2)
                break_a_wheel.publish(String(data="stuck_wheel"))
                pause(CUT_S / 2)
                proxy.mend()
                wait_until(lambda: stack.online() == {"sim_1"})
                pause(MARGIN_S)
                end_ns = clock.wall_ns()
                pause(0.5)
                client = GatewayClient(stack.url, key=stack.key)
                last_s = (clock.wall_ns() - start_ns) / SECOND + 1.0
                asked = client.post("/api/v1/robots/sim_1/recordings", {"last_s": round(last_s, 3)})
                path = f"/api/v1/recordings/{asked['id']}"
                wait_until(lambda: (stack.get(path) or {}).get("state") in ("stored", "failed"), timeout_s=120)
        shown = stack.get(path)
        assert shown["state"] == "stored", (shown, agent.output[-2000:])
        with client.open("GET", shown["url"]) as answer, (tmp_path / "clip.mcap").open("wb") as file:
            file.writelines(answer.pieces())
    truth, clip = seen(tmp_path / "truth.mcap"), seen(tmp_path / "clip.mcap")
    total, lacks = missing(truth, clip, start_ns, end_ns)
    assert lacks <= declared(tmp_path / "clip.mcap"), f"of {total}"
    assert len(lacks) < total / 50
    assert truth.keys() >= TOPICS
    log = [(log_ns, data) for (_, data), log_ns in clip["/rosout"].items() if b"fault stuck_wheel" in data]
    assert [start_ns < log_ns < end_ns for log_ns, _ in log] == [True], "what the robot said of it"
    assert total > 50 * CUT_S
    span_s = (end_ns - start_ns) / SECOND
    print(f"{total} messages of {span_s:.1f} s, {len(lacks)} missing, as declared; {shown['size_bytes']} bytes")
