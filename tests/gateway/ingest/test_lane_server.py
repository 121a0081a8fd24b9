"""How lanes end when their connection is torn down: told to nobody, and nothing for the log."""

from __future__ import annotations

import asyncio
import gc
import logging
import sys
from collections.abc import AsyncIterator
from types import SimpleNamespace
from typing import Any

import grpc
import pytest
import pytest_asyncio
from websockets.asyncio.client import connect
from websockets.typing import Subprotocol

from gateway.domain.identity import Peer
from gateway.errors import ProtocolError
from gateway.ingest.lane_limits import LaneLimits
from gateway.ingest.lane_server import LaneGoneError, serve_lane
from gateway.ingest.links import Lane, Links
from gateway.main import Ready
from metaros._proto import link_pb2, link_pb2_grpc
from metaros.clock import ManualClock
from metaros.limits import LIMITS
from tests.gateway.harness import CONTROL, ScriptedAgent, client, running_gateway
from tests.support.processes.processes import started
from tests.support.waiting import wait_until_async

pytestmark = pytest.mark.asyncio(loop_scope="module")

PUBLISH = link_pb2.PublishMessage(payload=bytes(512 * 1024))
FRAME = link_pb2.GatewayFrame(command=link_pb2.Command(command_id=b"c" * 16, publish=PUBLISH))
SUBPROTOCOL = Subprotocol("metaros.link.v1")
# A robot that says hello on one lane, reads its Welcome, and nothing more.
ROBOT = """
import sys, threading
import grpc
from metaros._proto import link_pb2, link_pb2_grpc

def frames():
    yield link_pb2.AgentFrame(hello=link_pb2.Hello(
        protocol=1, robot_id="sim_1", session_id=b"s" * 16, session_number=1, lane=link_pb2.LANE_CONTROL,
        agent_version="test", namespace="/sim_1", hostname="bench"))
    threading.Event().wait()

lane = link_pb2_grpc.LinkStub(grpc.insecure_channel(sys.argv[1])).Connect(frames())
assert next(lane).WhichOneof("frame") == "welcome"
print("up", flush=True)
threading.Event().wait()
"""


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def ready(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[Ready]:
    """A gateway for all tests here, each with robots of its own."""
    async with running_gateway(tmp_path_factory.mktemp("gateway")) as ready:
        yield ready


@pytest.fixture
def lanes(monkeypatch: pytest.MonkeyPatch) -> list[Lane]:
    """Every lane that is opened, as it is."""
    opened, join = [], Links.join

    async def joined(self: Links, *args: object) -> Lane:
        opened.append(await join(self, *args))  # type: ignore[arg-type]
        return opened[-1]

    monkeypatch.setattr(Links, "join", joined)
    return opened


async def filled(lane: Lane) -> None:
    """Until a write is under way that cannot end, as nobody reads."""
    await wait_until_async(lambda: not lane.outbox.put(FRAME), every_s=0.001)


def complaints(caplog: pytest.LogCaptureFixture) -> list[str]:
    """What the log has that somebody should look at."""
    gc.collect()  # tasks whose exception nobody asked for complain when they go
    return [f"{record.name}: {record.getMessage()}" for record in caplog.records if record.levelno >= logging.WARNING]


async def test_a_robot_killed_while_frames_are_written_to_it(
    ready: Ready, lanes: list[Lane], caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.DEBUG, "gateway")
    with started([sys.executable, "-c", ROBOT, f"127.0.0.1:{ready.grpc_port}"], text=True) as robot:
        assert robot.stdout is not None
        assert await asyncio.to_thread(robot.stdout.readline) == "up\n"
        (lane,) = lanes
        await filled(lane)
        robot.kill()
        await asyncio.to_thread(robot.wait)
        await wait_until_async(lambda: "gRPC did not take a frame" in caplog.text)
    async with client(ready) as http, ScriptedAgent(ready, "sim_2"):  # others are served as before
        assert (await http.get("/api/v1/robots/sim_2")).json()["state"] == "online"
    assert complaints(caplog) == []


async def test_a_socket_cut_while_frames_are_written_to_it(
    ready: Ready, lanes: list[Lane], caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.DEBUG, "gateway")
    hello = link_pb2.Hello(
        protocol=1, robot_id="sim_3", session_id=b"s" * 16, session_number=1, lane=CONTROL, agent_version="test"
    )
    url = ready.url.replace("http", "ws", 1) + "/api/v1/link"
    socket = await connect(url, subprotocols=[SUBPROTOCOL], proxy=None, max_size=None)
    await socket.send(link_pb2.AgentFrame(hello=hello).SerializeToString())
    await socket.recv()
    socket.transport.pause_reading()
    (lane,) = lanes
    await filled(lane)
    socket.transport.abort()
    await wait_until_async(lambda: "the socket is gone" in caplog.text)
    assert complaints(caplog) == []


async def test_whoever_takes_not_even_the_last_words_is_cut() -> None:
    links: Any = SimpleNamespace(lane_limits=LaneLimits(clock=ManualClock(), limits=LIMITS))

    async def read() -> link_pb2.AgentFrame:
        return link_pb2.AgentFrame(heartbeat=link_pb2.Heartbeat())

    for taken in (True, False):
        told: list[str] = []

        async def write(frame: link_pb2.GatewayFrame, *, taken: bool = taken, told: list[str] = told) -> None:
            told.append(frame.goodbye.code)
            if not taken:
                raise LaneGoneError("nobody is left")

        assert await serve_lane(links, read, write, peer=Peer(address="a")) is taken
        assert told == [ProtocolError.code]


async def test_what_is_no_frame_fills_no_log(ready: Ready, caplog: pytest.LogCaptureFixture) -> None:
    async with grpc.aio.insecure_channel(f"127.0.0.1:{ready.grpc_port}") as channel:
        call: Any = channel.stream_stream("/metaros.v1.Link/Connect")()
        await call.write(b"\xff\xff\xff")
        assert await call.read() is grpc.aio.EOF
        gone = link_pb2_grpc.LinkStub(channel).Connect()
        await gone.write(link_pb2.AgentFrame(heartbeat=link_pb2.Heartbeat()))  # refused, and away by then
        gone.cancel()
    async with ScriptedAgent(ready, "sim_4"):
        pass
    assert [text for text in complaints(caplog) if "a link was refused" not in text] == []
