"""Several gateways on one PostgreSQL, as processes, a router between them, and robots that feed them without a pause.

What tests and campaigns share that kill gateways: whatever happens, each sample that a robot accepted is stored once.
"""

from __future__ import annotations

import asyncio
import itertools
import json
import secrets
import time
from collections import Counter
from collections.abc import AsyncIterator, Sequence
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
from websockets.asyncio.client import connect
from websockets.exceptions import WebSocketException

from edge_agent.link.frames import CommandArrived
from gateway.identity.local_key import LOCAL_KEY_FILE
from gateway.store import Store
from gateway.store.objects import open_objects
from gateway.store.retention import Retention
from metaros.clock import SystemClock
from tests.support.gateways.memory_authenticator import bearer
from tests.support.gateways.plain_http import TRUSTS_NOBODY
from tests.support.gateways.viewer import records
from tests.support.ports import free_port
from tests.support.processes.stack import Program, Stack
from tests.support.robots.uplinks import Owner, feed, running, wait

__all__ = ["Fleet", "Replica", "Replicas", "Robot", "Watcher", "fleet"]

PAUSE_S = 0.02  # between two batches of a robot's


@dataclass
class Replica:
    """One of the gateways: where it listens, and its process now."""

    name: str
    http_port: int
    grpc_port: int
    folder: Path
    program: Program | None = None

    @property
    def url(self) -> str:
        """Where it serves HTTP."""
        return f"http://127.0.0.1:{self.http_port}"

    @property
    def link(self) -> str:
        """Where robots connect."""
        return f"127.0.0.1:{self.grpc_port}"

    @property
    def key(self) -> str:
        """Its administrator's key, while it runs; "" where it has none now."""
        try:
            return (self.folder / LOCAL_KEY_FILE).read_text().strip()
        except FileNotFoundError:
            return ""

    def client(self) -> httpx.AsyncClient:
        """An administrator's client of it."""
        return httpx.AsyncClient(
            base_url=self.url, headers=bearer(self.key), verify=TRUSTS_NOBODY, trust_env=False, timeout=30
        )


class Replicas:
    """`count` gateways of one store, that all start from the same settings."""

    def __init__(self, stack: Stack, url: str, *, count: int = 3, options: Sequence[str] = ()) -> None:
        self.stack = stack
        self.url = url
        self.objects = f"file://{stack.folder}/objects"
        self.router = free_port()
        stack.start("cluster-router", "router", "--zenoh-port", str(self.router))
        self._options = ("--heartbeat-s", "0.5", *options)
        self.all = [
            Replica(f"replica{number}", free_port(), free_port(), stack.folder / f"replica{number}")
            for number in range(1, count + 1)
        ]

    async def start(self) -> None:
        """All of them; they have met."""
        await asyncio.gather(*(self.begin(replica) for replica in self.all))
        for replica in self.all:
            await self.met(replica)

    async def met(self, replica: Replica) -> None:
        """Until it has met all the others that run."""
        row = f"metaros_cluster_peers {len(self.others(replica))}.0"
        async with asyncio.timeout(60), replica.client() as http:
            while True:
                if row in (await http.get("/metrics")).text:
                    return
                await asyncio.sleep(0.05)

    async def begin(self, replica: Replica) -> None:
        """Start one, be it for the first time or again."""
        shared = ("--store", self.url, "--objects", self.objects, "--cluster", f"tcp/127.0.0.1:{self.router}")
        key = ("--master-key", str(self.stack.folder / "master.key"))
        ports = ("--port", str(replica.http_port), "--grpc-port", str(replica.grpc_port), "--api-grpc-port", "0")
        viewers = ("--foxglove-port", "off", "--rosbridge-port", "off", "--requests-per-s", "0")
        where = ("--data-dir", str(replica.folder))
        arguments = ("gateway", *shared, *key, *ports, *viewers, *where, *self._options)
        replica.program = await asyncio.to_thread(self.stack.start, replica.name, *arguments)

    def kill(self, replica: Replica) -> None:
        """kill -9."""
        assert replica.program is not None
        replica.program.kill()
        self.stack.programs.remove(replica.program)
        replica.program = None

    async def end(self, replica: Replica) -> int:
        """SIGTERM, and wait; its exit code."""
        assert replica.program is not None
        replica.program.process.terminate()
        code = await asyncio.to_thread(replica.program.process.wait, 60)
        self.stack.programs.remove(replica.program)
        replica.program = None
        return code

    def others(self, *gone: Replica) -> list[Replica]:
        """Those that run and are not these."""
        return [replica for replica in self.all if replica.program is not None and replica not in gone]

    async def stored(self, robot: str) -> list[bytes]:
        """Every payload that the store has of a robot, with nothing declared lost."""
        folder = self.stack.folder / f"reader-{secrets.token_hex(4)}"
        folder.mkdir()
        objects = await asyncio.to_thread(open_objects, self.objects, folder)
        retention = Retention(age_s=86400, size_bytes=1 << 34)
        store = Store(
            folder, clock=SystemClock(), retention=retention, queue_bytes=1 << 20, url=self.url, objects=objects
        )
        store.start()
        try:
            assert await store.gaps(robot, limit=10) == [], "nothing is declared lost"
            return [payload for batch in await store.samples(robot, limit=100_000) for _, _, payload in batch.samples()]
        finally:
            await store.close()
            await asyncio.to_thread(objects.close)


class Robot:
    """An agent's uplink that knows all replicas, another one first for each robot, and is fed all the while."""

    def __init__(self, name: str, replicas: Replicas, first: int, *, pause_s: float = PAUSE_S) -> None:
        self.name = name
        self.pause_s = pause_s
        self.owner = Owner(robot=name)
        self.sent: list[bytes] = []
        links = [replica.link for replica in replicas.all]
        self.addresses = links[first:] + links[:first]
        self.back_s: list[float] = []  # from each kill of its replica to its next session

    @property
    def home(self) -> str:
        """Where its link is, or was."""
        return self.owner.facts.gateway

    @property
    def commands(self) -> Counter[str]:
        """How often each command came, by its id."""
        arrived = [event.command for event in self.owner.events if isinstance(event, CommandArrived)]
        return Counter(str(command.command_id) for command in arrived)

    async def feed(self, uplink: Any) -> None:
        """Until cancelled."""
        for batch in itertools.count():
            fresh = [f"{self.name} {batch} {number} ".encode() * 5 for number in range(10)]
            self.sent.extend(fresh)
            feed(self.owner, uplink, fresh)
            await asyncio.sleep(self.pause_s)

    async def timed(self, ups: int) -> None:
        """Note how long the next session takes."""
        began = time.monotonic()
        await wait(lambda: self.owner.ups > ups and self.owner.outbox.online)
        self.back_s.append(time.monotonic() - began)


class Watcher:
    """A page that watches all robots at one replica, and goes on at another one when that ends."""

    def __init__(self, replicas: Replicas, first: int) -> None:
        self._replicas = replicas
        self.at = replicas.all[first]
        self.seen: Counter[tuple[str, str]] = Counter()  # by replica and robot
        self.events: list[str] = []  # their ids
        self.last_event = 0

    async def watch(self) -> None:
        """Samples, over the WebSocket; until cancelled."""
        while True:
            at = self.at
            try:
                address = at.url.replace("http", "ws", 1) + "/api/v1/stream"
                headers = bearer(at.key)
                options: dict[str, Any] = {"origin": at.url, "max_size": None, "compression": None, "proxy": None}
                async with connect(address, additional_headers=headers, **options) as socket:
                    await socket.send(json.dumps({"op": "subscribe", "id": 1, "robots": "*", "topics": "**"}))
                    while True:
                        message = await socket.recv()
                        if isinstance(message, bytes):
                            for record in records(message):
                                self.seen[at.name, record.payload.split(b" ", 1)[0].decode()] += 1
            except (OSError, WebSocketException):
                self._move(at)
                await asyncio.sleep(0.05)

    async def listen(self) -> None:
        """Events, as server-sent events that go on behind the last one; until cancelled."""
        while True:
            at = self.at
            try:
                headers = {"accept": "text/event-stream", "last-event-id": str(self.last_event)}
                async with at.client() as http, http.stream("GET", "/api/v1/events", headers=headers) as answer:
                    async for line in answer.aiter_lines():
                        if line.startswith("id: "):
                            self.last_event = int(line[4:])
                        elif line.startswith("data: ") and "specversion" in line:
                            self.events.append(json.loads(line[6:])["id"])
            except (OSError, httpx.HTTPError):
                pass
            self._move(at)
            await asyncio.sleep(0.05)

    def _move(self, left: Replica) -> None:
        others = self._replicas.others(left)
        if self.at is left and others:
            self.at = others[0]


@dataclass
class Fleet:
    """What runs in `fleet`."""

    replicas: Replicas
    robots: list[Robot]
    watcher: Watcher
    tasks: list[asyncio.Task[None]] = field(default_factory=list)

    async def back(self, ups: dict[str, int]) -> None:
        """Each robot whose sessions were so many has another one."""
        await asyncio.gather(*(robot.timed(ups[robot.name]) for robot in self.robots if robot.name in ups))

    def homed(self, replica: Replica) -> dict[str, int]:
        """The sessions so far of the robots whose link is there."""
        return {robot.name: robot.owner.ups for robot in self.robots if robot.home.endswith(f":{replica.grpc_port}")}

    async def kill(self, replica: Replica) -> dict[str, int]:
        """kill -9; which robots it had, and their sessions so far."""
        homed = self.homed(replica)
        self.replicas.kill(replica)
        return homed

    async def settle(self) -> None:
        """Feed no more; everything that was accepted is acknowledged."""
        for task in self.tasks:
            if task.get_name().startswith("feed"):
                task.cancel()
        await wait(lambda: all(robot.owner.held == 0 for robot in self.robots), timeout_s=120)


@asynccontextmanager
async def fleet(replicas: Replicas, *, robots: int = 3, pause_s: float = PAUSE_S) -> AsyncIterator[Fleet]:
    """Robots at work, a viewer, and all replicas up."""
    await replicas.start()
    count = len(replicas.all)
    fed = [Robot(f"r{n + 1}", replicas, n % count, pause_s=pause_s) for n in range(robots)]
    made = Fleet(replicas, fed, Watcher(replicas, 0))
    async with AsyncExitStack() as stack:
        for robot in made.robots:
            _, uplink = await stack.enter_async_context(running(*robot.addresses, owner=robot.owner))
            await wait(lambda robot=robot: robot.owner.ups == 1)
            made.tasks.append(asyncio.create_task(robot.feed(uplink), name=f"feed {robot.name}"))
        made.tasks += [asyncio.create_task(made.watcher.watch()), asyncio.create_task(made.watcher.listen())]
        try:
            yield made
        finally:
            for task in made.tasks:
                task.cancel()
            await asyncio.gather(*made.tasks, return_exceptions=True)
