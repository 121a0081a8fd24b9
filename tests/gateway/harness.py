"""A real gateway in this process, and a small scripted agent that speaks to it over a real gRPC channel."""

from __future__ import annotations

import asyncio
import functools
import json
import ssl
import tempfile
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import grpc
import httpx
from argon2 import PasswordHasher
from websockets.asyncio.client import ClientConnection, connect

from gateway.domain.principal import Role
from gateway.identity.authenticator import Authenticator
from gateway.identity.passwords import Passwords
from gateway.main import Ready, serve
from gateway.settings import Settings
from gateway.store.private_dir import make_private
from gateway.store.sqlite import DATABASE, SqliteEngine
from metaros._proto import link_pb2, link_pb2_grpc
from metaros.clock import Clock, SystemClock
from metaros.idl import schema_text, type_hash
from metaros.limits import LIMITS
from metaros.link import pack_batch, pack_metrics
from tests.support.gateways.memory_authenticator import KeyRing, bearer
from tests.support.gateways.plain_http import TRUSTS_NOBODY

LANE_OPTIONS = (("grpc.use_local_subchannel_pool", 1), ("grpc.enable_retries", 0))  # as agents have them
CONTROL, DATA, BACKFILL = link_pb2.LANE_CONTROL, link_pb2.LANE_DATA, link_pb2.LANE_BACKFILL
EPOCH = 77
RING = KeyRing()
QUICK = PasswordHasher(time_cost=1, memory_cost=8, parallelism=1)  # what a real hash costs is for its own tests
OPERATOR_KEY = RING.add(role=Role.OPERATOR, name="test operator")


@asynccontextmanager
async def running_gateway(
    folder: Path, *, authenticator: Authenticator | None = None, clock: Clock | None = None, **settings: Any
) -> AsyncIterator[Ready]:
    """A gateway on free ports, stopped at the end as a signal would stop it; it knows the keys of `authenticator`,
    and hashes passwords in no time.
    """
    stop, up = asyncio.Event(), asyncio.get_running_loop().create_future()
    chosen = Settings(
        **{
            "port": 0,
            "grpc_port": 0,
            "api_grpc_port": 0,
            "foxglove_port": 0,
            "rosbridge_port": 0,
            "data_dir": folder / "data",
            **settings,
        }
    )
    if not chosen.data_dir.exists() and not chosen.store_url:
        (make_private(chosen.data_dir) / DATABASE).write_bytes(_empty_store())
    passwords = Passwords(hasher=QUICK)
    serving = serve(
        chosen, stop, clock=clock, on_ready=up.set_result, authenticator=authenticator or RING, passwords=passwords
    )
    task = asyncio.create_task(serving)
    await asyncio.wait({task, up}, return_when=asyncio.FIRST_COMPLETED)
    try:
        yield up.result() if up.done() else task.result()
    finally:
        stop.set()
        await asyncio.wait_for(task, 60)


@functools.cache
def _empty_store() -> bytes:
    """The file of a store with its tables and nothing in it, made once a process: it is half of a gateway's start."""
    with tempfile.TemporaryDirectory() as folder:
        engine = SqliteEngine(Path(folder))
        engine.open()
        engine.connection.execute("DELETE FROM meta WHERE key = 'store_id'")  # each makes its own
        engine.close()
        return (Path(folder) / DATABASE).read_bytes()


def client(ready: Ready, *, key: str = OPERATOR_KEY, **headers: str) -> httpx.AsyncClient:
    """An HTTP client of that gateway, an operator's unless another key is given; "": nobody's."""
    verify, said = trusting(ready) or TRUSTS_NOBODY, {**bearer(key), **headers}
    # As patient as `wait_until`: a password's hash takes its time where the machine is busy.
    return httpx.AsyncClient(base_url=ready.url, headers=said, trust_env=False, verify=verify, timeout=60)


async def knows(ready: Ready, robot: str, *topics: str) -> None:
    """Return once the gateway has read that the robot has these topics: a request may overtake an announcement."""
    async with client(ready) as http, asyncio.timeout(60):
        while True:
            found = (await http.get(f"/api/v1/robots/{robot}/topics")).json()["topics"]
            if {one["topic"] for one in found}.issuperset(topics):
                return


def trusting(ready: Ready) -> ssl.SSLContext | None:
    """TLS that the gateway's own root alone vouches for; None where it has none."""
    return ssl.create_default_context(cadata=ready.roots_pem) if ready.roots_pem else None


def open_socket(ready: Ready, path: str, *, key: str = OPERATOR_KEY, **options: Any) -> connect:
    """A WebSocket as a page of the gateway itself opens it."""
    url = ready.url.replace("http", "ws", 1) + path
    if ready.tls:
        options = {"ssl": trusting(ready), **options}
    headers = bearer(key)
    return connect(
        url, origin=ready.url, max_size=None, compression=None, proxy=None, additional_headers=headers, **options
    )


async def say(socket: ClientConnection, **request: Any) -> None:
    """Send a JSON request."""
    await socket.send(json.dumps(request))


async def flood(socket: ClientConnection, *, at_once: int = 700, **request: Any) -> None:
    """Say the same until the socket ends: more at once than may be, and twice as much if that was not enough.

    Somebody else has to hear what is answered.
    """
    while True:
        for _ in range(at_once):
            await say(socket, **request)
        await (await socket.ping())
        at_once *= 2


async def hear(socket: ClientConnection, op: str, *, timeout_s: float = 60.0) -> dict[str, Any]:
    """The next JSON message with that op."""
    async with asyncio.timeout(timeout_s):
        while True:
            message = await socket.recv()
            if isinstance(message, str) and json.loads(message)["op"] == op:
                return dict(json.loads(message))


async def hear_bytes(socket: ClientConnection, *, timeout_s: float = 60.0) -> bytes:
    """The next binary frame."""
    async with asyncio.timeout(timeout_s):
        while True:
            message = await socket.recv()
            if isinstance(message, bytes):
                return message


def channel(number: int, topic: str, schema_name: str, *, delivery: int = 3, rate: float = 0.0) -> link_pb2.Channel:
    """An announced channel with its real schema."""
    announced = link_pb2.Channel(
        channel_id=number,
        topic=topic,
        encoding="cdr",
        schema_name=schema_name,
        schema_encoding="ros2msg",
        schema=schema_text(schema_name).encode(),
        type_hash=type_hash(schema_name),
        max_rate_hz=rate,
        forward=True,
    )
    setattr(announced, "class", delivery)
    return announced


class ScriptedAgent:
    """Three lanes and what came down on them; every frame is sent when the test says so."""

    def __init__(self, ready: Ready, robot: str = "sim_1", *, number: int = 1, session: bytes = b"s" * 16) -> None:
        self.robot, self.number, self.session = robot, number, session
        self._target = f"127.0.0.1:{ready.grpc_port}"
        self._channels: list[grpc.aio.Channel] = []
        self.lanes: dict[int, Any] = {}
        self.frames: dict[int, asyncio.Queue[link_pb2.GatewayFrame]] = {
            lane: asyncio.Queue() for lane in (CONTROL, DATA, BACKFILL)
        }
        self.welcomes: dict[int, link_pb2.Welcome] = {}
        self._writing = {lane: asyncio.Lock() for lane in (CONTROL, DATA, BACKFILL)}
        self._readers: list[asyncio.Task[None]] = []

    async def __aenter__(self) -> ScriptedAgent:
        for lane in (CONTROL, DATA, BACKFILL):
            await self.open(lane)
        return self

    async def __aexit__(self, *_exc: object) -> None:
        for reader in self._readers:
            reader.cancel()
        await asyncio.gather(*self._readers, return_exceptions=True)
        for lane in self.lanes.values():
            lane.cancel()
        for opened in self._channels:
            await opened.close()

    async def open(self, lane: int, streams: Sequence[link_pb2.StreamState] = (), *, welcome: bool = True) -> None:
        """Connect a lane and say hello."""
        opened = grpc.aio.insecure_channel(self._target, LANE_OPTIONS)
        self._channels.append(opened)
        call = self.lanes[lane] = link_pb2_grpc.LinkStub(opened).Connect()
        self._readers.append(asyncio.create_task(self._read(lane, call)))
        hello = link_pb2.Hello(
            protocol=1,
            robot_id=self.robot,
            session_id=self.session,
            session_number=self.number,
            lane=lane,
            agent_version="test",
            namespace=f"/{self.robot}",
            hostname="bench",
            streams=streams,
        )
        await call.write(link_pb2.AgentFrame(hello=hello))
        if welcome:
            self.welcomes[lane] = (await self.next("welcome", lane)).welcome

    async def next(self, kind: str, lane: int = CONTROL, *, timeout_s: float = 60.0) -> link_pb2.GatewayFrame:
        """The next frame of that kind; others before it are dropped."""
        async with asyncio.timeout(timeout_s):
            while True:
                frame = await self.frames[lane].get()
                if frame.WhichOneof("frame") == kind:
                    return frame

    @asynccontextmanager
    async def beating(self) -> AsyncIterator[None]:
        """It says on the control lane that it lives, as agents do: for tests that may last longer than a gateway waits
        for a word.
        """

        async def beat() -> None:
            while True:
                await self.send(CONTROL, heartbeat=link_pb2.Heartbeat(sent_ns=SystemClock().wall_ns()))
                await asyncio.sleep(LIMITS.dead_after_s / 10)

        task = asyncio.create_task(beat())
        try:
            yield
        finally:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)

    async def send(self, lane: int = DATA, **frame: Any) -> None:
        """Write one frame, one after the other on each lane."""
        async with self._writing[lane]:
            writing = asyncio.ensure_future(self.lanes[lane].write(link_pb2.AgentFrame(**frame)))
            try:
                await asyncio.shield(writing)
            except asyncio.CancelledError:  # gRPC takes no other one before this has left
                await asyncio.wait({writing})
                raise

    async def announce(self, *channels: link_pb2.Channel, series: Sequence[link_pb2.Series] = ()) -> None:
        """Declare channels and series on all lanes, as agents do."""
        for lane in (CONTROL, DATA, BACKFILL):
            await self.send(lane, announce=link_pb2.Announce(channels=channels, series=series))

    async def samples(
        self,
        number: int,
        first_seq: int,
        payloads: Sequence[bytes],
        *,
        stamp_ns: int = 1000,
        step_ns: int = 1,
        epoch: int = EPOCH,
    ) -> None:
        """Send one batch; of its stamps the first, and how far they are apart."""
        stamps = [stamp_ns + index * step_ns for index in range(len(payloads))]
        batch = pack_batch(number, epoch, first_seq, stamps, payloads)
        await self.send(batches=link_pb2.Batches(batches=[batch]))

    async def rows(self, first_seq: int, rows: Sequence[tuple[int, int, float]], *, epoch: int = EPOCH) -> None:
        """Send metric rows (series, stamp, value)."""
        series, stamps, values = zip(*rows, strict=True)
        await self.send(metrics=pack_metrics(epoch, first_seq, series, stamps, values))

    async def settled(self, wanted: dict[int, int]) -> None:
        """Wait until so much of each stream is acknowledged; metric rows are stream 0."""
        left = dict(wanted)
        while left:
            for mark in (await self.next("ack", DATA)).ack.watermarks:
                if left.get(mark.stream_id, 1 << 62) <= mark.seq:
                    del left[mark.stream_id]

    async def answer(self, command: link_pb2.Command, *, payload: bytes = b"", code: str = "") -> None:
        """Send a command's result."""
        result = link_pb2.CommandResult(
            command_id=command.command_id, ok=not code, code=code, message=code, payload=payload
        )
        await self.send(CONTROL, result=result)

    async def _read(self, lane: int, call: Any) -> None:
        try:
            while (frame := await call.read()) is not grpc.aio.EOF:
                await self.frames[lane].put(frame)
        except (grpc.aio.AioRpcError, asyncio.CancelledError):
            return
