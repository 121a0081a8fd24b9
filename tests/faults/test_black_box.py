"""The black box with real processes: a link that is cut, something happens, and the minute is there in full afterwards.

A robot's agent reaches its gateway through a proxy that is cut. Three topics go on at full rate meanwhile, two of them
of the live class that nobody watches; somewhere in the middle there is a fault. `METAROS_CUT_S` sets how long the link
is away. There is one cut, of which each test wants a recording of its own.
"""

from __future__ import annotations

import hashlib
import io
import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader
from rosbags.rosbag2 import Reader as RosReader

from metaros.cli.shared.gateway_http import GatewayClient
from metaros.interfaces.sensor_msgs.msg import CompressedImage
from metaros.interfaces.std_msgs.msg import String, UInt64
from metaros.node import Context, Node
from metaros.wire.qos import qos_reliable_all
from tests.support.processes.stack import Program, Stack
from tests.support.servers.cutting_proxy import CuttingProxy
from tests.support.waiting import wait_until

pytestmark = pytest.mark.integration

CUT_S = float(os.environ.get("METAROS_CUT_S", "5"))
MARGIN_S = 1.0
LATER_S = 1.5  # from when somebody asks until the link is back
SECOND = 10**9
IMAGE_BYTES = 8000
RATES_HZ = {"/robot/odom": 50.0, "/robot/imu": 200.0, "/robot/camera/compressed": 15.0}
FAULT = "motor 2: stalled"
SLOW_BYTES_PER_S, FAST_BYTES_PER_S = 100_000, 10_000_000


@dataclass
class Publisher:
    """Publishes numbered messages on every topic at its rate, and knows when each left."""

    context: Context
    sent: dict[str, list[int]] = field(default_factory=lambda: {topic: [] for topic in RATES_HZ})
    stop: threading.Event = field(default_factory=threading.Event)

    @contextmanager
    def running(self) -> Iterator[Publisher]:
        """With a thread for each topic."""
        with Node("base", namespace="/robot", context=self.context) as node:
            self.faults = node.create_publisher(String, "fault", 10)
            threads = [threading.Thread(target=self._publish, args=(node, topic)) for topic in RATES_HZ]
            for thread in threads:
                thread.start()
            try:
                yield self
            finally:
                self.stop.set()
                for thread in threads:
                    thread.join(60)

    def between(self, topic: str, start_ns: int, end_ns: int) -> list[int]:
        """The numbers of the messages that left then."""
        return [number for number, left_ns in enumerate(self.sent[topic]) if start_ns <= left_ns <= end_ns]

    def _publish(self, node: Node, topic: str) -> None:
        image = topic.endswith("compressed")
        # Publishers that wait: what a busy machine drops before it reaches the agent is no business of the black box.
        publisher = node.create_publisher(CompressedImage if image else UInt64, topic, qos_reliable_all)
        left, due_s = self.sent[topic], node.clock.monotonic_s()
        while not self.stop.is_set():
            number = len(left)
            left.append(node.clock.wall_ns())
            if image:  # of which little can be compressed
                publisher.publish(
                    CompressedImage(format="jpeg", data=os.urandom(IMAGE_BYTES) + number.to_bytes(8, "little"))
                )
            else:
                publisher.publish(UInt64(data=number))
            due_s += 1 / RATES_HZ[topic]
            self.stop.wait(max(0.0, due_s - node.clock.monotonic_s()))


@dataclass
class World:
    """A robot behind a proxy, publishing."""

    stack: Stack
    proxy: CuttingProxy
    publisher: Publisher
    agent: Program
    gateway: Program
    start_ns: int = 0  # of the cut
    asked_ns: int = 0
    asked: dict[str, Any] = field(default_factory=dict)  # while there was no link

    @property
    def client(self) -> GatewayClient:
        """Of the gateway's API."""
        return GatewayClient(self.stack.url, key=self.stack.key)

    def online(self) -> bool:
        """Whether the gateway has the robot's link."""
        return self.stack.online() == {"robot"}

    def save(self) -> dict[str, Any]:
        """Ask for a recording from before the cut until now."""
        last_s = (self.publisher.context.clock.wall_ns() - self.start_ns) / SECOND + MARGIN_S
        return dict(self.client.post("/api/v1/robots/robot/recordings", {"last_s": round(last_s, 3)}))

    def stored(self, recording: dict[str, Any]) -> dict[str, Any]:
        """It, once the gateway has it."""
        shown: dict[str, Any] = {}

        def ended() -> bool:
            shown.update(self.stack.get(f"/api/v1/recordings/{recording['id']}") or {"state": ""})
            return shown["state"] in ("stored", "failed")

        wait_until(ended, timeout_s=120)
        assert shown["state"] == "stored", (shown, self.agent.output[-3000:])
        return shown

    def file(self, recording: dict[str, Any]) -> bytes:
        """Its bytes."""
        with self.client.open("GET", recording["url"]) as answer:
            return b"".join(answer.pieces())


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Iterator[World]:
    """Everything ran, the link was cut, something happened in the middle, somebody asked, and the link is back."""
    with Stack(tmp_path_factory.mktemp("world")) as stack:
        stack.router()
        endpoint = f"tcp/127.0.0.1:{stack.zenoh_port}"
        with (
            CuttingProxy(stack.grpc_port) as proxy,
            Context(connect=[endpoint], shared_memory="off") as context,
            Publisher(context).running() as publisher,
        ):
            gateway, agent = stack.at_once(
                stack.gateway, lambda: stack.agent("robot", "--gateway", f"127.0.0.1:{proxy.port}")
            )
            world = World(stack, proxy, publisher, agent, gateway)
            wait_until(world.online)
            wait_until(lambda: set(RATES_HZ) <= set(stack.topics("robot")))  # the agent's tap has seen them
            cut_with_a_fault(world)
            yield world


def pause(seconds: float) -> None:
    """The time that the story takes."""
    threading.Event().wait(seconds)


def cut_with_a_fault(world: World) -> None:
    """Cut the link, let something happen in the middle, ask for it at the end, and mend the link some time after."""
    clock = world.publisher.context.clock
    pause(MARGIN_S)
    world.proxy.cut_after(up=0)
    wait_until(lambda: not world.online())
    world.start_ns = clock.wall_ns()
    pause(CUT_S / 2)
    world.publisher.faults.publish(String(data=FAULT))
    pause(CUT_S / 2)
    world.asked = world.save()
    world.asked_ns = clock.wall_ns()
    pause(LATER_S)
    world.proxy.mend()
    wait_until(world.online)


def numbers(blob: bytes) -> dict[str, list[int]]:
    """The numbers in a file, by topic, in its order."""
    found: dict[str, list[int]] = {}
    for _schema, channel, message in make_reader(io.BytesIO(blob)).iter_messages():
        if channel.topic in RATES_HZ:
            data = message.data[-8:] if channel.topic.endswith("compressed") else message.data[4:12]
            found.setdefault(channel.topic, []).append(int.from_bytes(data, "little"))
    return found


def gaps(blob: bytes) -> str:
    """What the file itself says is missing."""
    return str([record.metadata for record in make_reader(io.BytesIO(blob)).iter_metadata() if "gaps" in record.name])


def check_full(world: World, blob: bytes) -> int:
    """Every message that left while there was no link, until somebody asked, is in the file, once; how many those are.

    Of the second before nobody can say whether it came to the agent before somebody asked.
    """
    found, total = numbers(blob), 0
    for topic, rate in RATES_HZ.items():
        wanted = world.publisher.between(topic, world.start_ns, world.asked_ns - SECOND)
        assert len(wanted) > rate * CUT_S / 4, f"{topic}: only {len(wanted)} were published"
        missing = sorted(set(wanted) - set(found[topic]))
        assert not missing, f"{topic}: {len(missing)} are missing: {missing[:20]}; declared: {gaps(blob)}"
        assert len(found[topic]) == len(set(found[topic])), f"{topic}: some are there twice"
        total += len(wanted)
    return total


def test_the_minute_of_the_cut_is_there_in_full(world: World, tmp_path: Path) -> None:
    clock = world.publisher.context.clock
    since_s = clock.monotonic_s()
    recording = world.stored(world.save())
    took_s = clock.monotonic_s() - since_s
    blob = world.file(recording)

    total = check_full(world, blob)
    assert hashlib.sha256(blob).hexdigest() == recording["sha256"]
    faults = [m.data for _, c, m in make_reader(io.BytesIO(blob)).iter_messages() if c.topic == "/robot/fault"]
    assert [FAULT.encode() in data for data in faults] == [True]
    assert recording["messages"] == sum(1 for _ in make_reader(io.BytesIO(blob)).iter_messages())
    path = tmp_path / "clip.mcap"
    path.write_bytes(blob)
    with RosReader(path) as bag:
        assert set(RATES_HZ) <= set(bag.topics)
        assert sum(1 for _ in bag.messages()) == recording["messages"]
    print(f"{total} messages of {CUT_S:g} s without a link, all there; {len(blob)} bytes stored {took_s:.1f} s after")


def test_asked_without_a_link_it_comes_with_the_link(world: World) -> None:
    assert world.asked["state"] == "requested"
    blob = world.file(world.stored(world.asked))
    assert check_full(world, blob) > 0
    until_then = world.publisher.between("/robot/imu", 0, world.asked_ns + round(LATER_S * SECOND / 2))
    assert max(numbers(blob)["/robot/imu"]) <= until_then[-1], "it ends when it was asked"


def test_deaths_of_both_sides_on_the_way_change_nothing(world: World) -> None:
    def uplink(bytes_per_s: int) -> None:
        with world.client.open("PUT", "/api/v1/robots/robot/uplink", body={"bytes_per_s": bytes_per_s}):
            pass

    uplink(SLOW_BYTES_PER_S)  # so slow that everybody can die on the way
    asked = world.save()
    path = f"/api/v1/recordings/{asked['id']}"

    def received(least: int) -> bool:
        shown = world.stack.get(path) or {"received_bytes": 0, "state": ""}
        return shown["received_bytes"] >= least or shown["state"] == "stored"

    wait_until(lambda: received(1))
    before = dict(world.stack.get(path))
    assert before["state"] == "transferring"
    world.gateway.kill()
    world.gateway = world.stack.restart(world.gateway)
    wait_until(world.online)
    wait_until(lambda: received(before["received_bytes"] + 1))
    assert dict(world.stack.get(path))["state"] == "transferring", "the agent's death comes too late"
    os.kill(world.agent.process.pid, signal.SIGKILL)
    world.agent.process.wait(60)
    world.agent = world.stack.restart(world.agent)
    wait_until(world.online)
    uplink(FAST_BYTES_PER_S)
    recording = world.stored(asked)
    check_full(world, world.file(recording))
    kept = world.stack.folder / "agent-robot" / "recordings"
    wait_until(lambda: not list(kept.glob("*.mcap")))
