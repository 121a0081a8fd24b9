"""Sends the state of local robots to the other gateways: a snapshot when one joins, then deltas.

Links and channels are sent at once, values and counts periodically, the same message to all. Nothing
waits in a queue: messages are built from the records. A gateway that takes no more gets a snapshot later.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Iterable, Iterator, Mapping
from typing import Final

from gateway.cluster.mirror.deltas import Piece, SentSchemas, SentState, delta_of, first_snapshot_of, snapshot_of
from gateway.cluster.ports import Mesh
from gateway.ingest.registry import Registry
from metaros._proto import cluster_pb2
from metaros.clock import Clock

__all__ = ["LOOK_S", "MIRROR", "MIRROR_AGAIN", "MIRROR_FAST", "MirrorSender"]

log = logging.getLogger(__name__)

MIRROR: Final = "mirror"
MIRROR_AGAIN: Final = "mirror.again"
MIRROR_FAST: Final = "mirror.fast"
LOOK_S: Final = 0.5  # how often values and counts are sent
FAST_S: Final = 0.05  # how often values are, while somebody looks at them elsewhere
AT_ONCE: Final = 16  # robots per step, before other tasks of the event loop run
WHOLE_AT_ONCE: Final = 4  # robots per step of a snapshot, which its receiver has to read
PAGE_BYTES: Final = 12 * 1024  # of one message, about; a millisecond's work to take in
TEXTS_BYTES: Final = 256 * 1024  # and of schemas in it, which are no work
TEXTS_AT_ONCE: Final = 16  # of 256 KiB at most
PAUSE_S: Final = 0.001  # between parts of all of it: who reads them has other things to do
FULL_S: Final = 0.05  # until a gateway that took no more is tried again


class MirrorSender:
    """All methods on the event loop; `run` it beside the links."""

    def __init__(self, mesh: Mesh, registry: Registry, *, clock: Clock, look_s: float = LOOK_S) -> None:
        self._mesh = mesh
        self._registry = registry
        self._clock = clock
        self._look_s = look_s
        self._sent: dict[str, SentState] = {}  # by robot that is linked here
        self._schemas = SentSchemas()
        self._now: dict[str, None] = {}  # whose link or channels are news
        self._values: dict[str, dict[str, tuple[int, float]]] = {}
        self._current: set[str] = set()  # gateways that get deltas
        self._behind: dict[str, None] = {}  # those that need a snapshot
        self._stirred = asyncio.Event()
        self._wanted = asyncio.Event()  # somebody is behind
        self._fast: set[str] = set()  # gateways where somebody looks at values
        mesh.on_message(MIRROR_AGAIN, self._on_again)
        mesh.on_message(MIRROR_FAST, self._on_fast)
        mesh.on_peer(self._on_peer)

    def on_online(self, robot: str, online: bool) -> None:
        """A robot's link to this gateway came or went."""
        if online:
            self._sent[robot] = SentState()
        else:
            self._sent.pop(robot, None)
            self._values.pop(robot, None)
        self._stir(robot)

    def on_channels(self, robot: str) -> None:
        """Something was announced here."""
        if robot in self._sent:
            self._stir(robot)

    def on_values(self, robot: str, values: Mapping[str, tuple[int, float]]) -> None:
        """Newest values of series came here."""
        if self._current and robot in self._sent:
            self._values.setdefault(robot, {}).update(values)

    async def run(self) -> None:
        """Until cancelled."""
        async with asyncio.TaskGroup() as group:
            group.create_task(self._send_at_once())
            group.create_task(self._send_in_time())
            group.create_task(self._send_snapshots())

    def _stir(self, robot: str) -> None:
        self._now[robot] = None
        self._stirred.set()

    def _on_peer(self, gateway: str, came: bool) -> None:
        self._current.discard(gateway)
        self._fast.discard(gateway)
        self._behind.pop(gateway, None)
        if came:
            self._fell_behind(gateway)

    def _on_again(self, sender: str, payload: bytes) -> None:
        for robot in cluster_pb2.MirrorAgain.FromString(payload).robots:
            if robot in self._sent:
                self._sent[robot] = SentState()
                self._stir(robot)

    def _on_fast(self, sender: str, payload: bytes) -> None:
        if payload and sender in self._mesh.peers():
            self._fast.add(sender)
        else:
            self._fast.discard(sender)

    def _fell_behind(self, gateway: str) -> None:
        self._current.discard(gateway)
        self._behind[gateway] = None
        self._wanted.set()

    async def _send_at_once(self) -> None:
        while True:
            await self._stirred.wait()
            self._stirred.clear()
            now, self._now = list(self._now), {}
            await self._send(now, announced=True, look=False)

    async def _send_in_time(self) -> None:
        looked_s = self._clock.monotonic_s()
        while True:
            await asyncio.sleep(FAST_S if self._fast else self._look_s)
            now_s = self._clock.monotonic_s()
            if now_s - looked_s >= self._look_s:
                looked_s = now_s
                await self._send(list(self._sent), announced=False, look=True)
            elif self._values:
                await self._send(list(self._values), announced=False, look=False)

    async def _send(self, robots: list[str], *, announced: bool, look: bool) -> None:
        """Send deltas of these robots to all that have a snapshot."""
        for start in range(0, len(robots), AT_ONCE):
            if not self._current:
                self._values.clear()
                return
            pieces = self._news(robots[start : start + AT_ONCE], announced=announced, look=look)
            for message in _pages(pieces):
                for gateway in list(self._current):
                    if not self._mesh.send(gateway, MIRROR, message):
                        self._fell_behind(gateway)
            await asyncio.sleep(0)
        if self._schemas.full:
            self._schemas = SentSchemas()
            for gateway in list(self._current):
                self._fell_behind(gateway)

    def _news(self, robots: Iterable[str], *, announced: bool, look: bool) -> Iterator[Piece]:
        now_s = self._clock.monotonic_s()
        for robot in robots:
            sent = self._sent.get(robot)
            if sent is None:
                if announced:
                    yield cluster_pb2.MirroredRobot(robot=robot, gone=True), []
                continue
            record, values = self._registry.get(robot), self._values.pop(robot, {})
            if sent.robot is None:
                yield from first_snapshot_of(record, sent, self._schemas, now_s=now_s)
            else:
                yield from delta_of(
                    record, sent, self._schemas, values=values, now_s=now_s, announced=announced, look=look
                )

    async def _send_snapshots(self) -> None:
        while True:
            await self._wanted.wait()
            self._wanted.clear()
            while self._behind:
                await self._send_snapshot(next(iter(self._behind)))

    async def _send_snapshot(self, gateway: str) -> None:
        """From here on it also gets what changes: that is of a robot that it knows, or it is told of that robot yet."""
        self._behind.pop(gateway)
        self._current.add(gateway)
        schemas = self._schemas.copy()
        texts = list(schemas.texts.values())
        head = cluster_pb2.Mirror(anew=True).SerializeToString()
        if not await self._deliver(gateway, head):
            return
        for start in range(0, len(texts), TEXTS_AT_ONCE):
            message = cluster_pb2.Mirror(schemas=texts[start : start + TEXTS_AT_ONCE]).SerializeToString()
            if not await self._deliver(gateway, message):
                return
        robots = list(self._sent)
        for start in range(0, len(robots), WHOLE_AT_ONCE):
            some = [robot for robot in robots[start : start + WHOLE_AT_ONCE] if robot in self._sent]
            fresh = [robot for robot in some if self._sent[robot].robot is None]  # nobody knows them yet
            pages = list(_pages(self._whole([robot for robot in some if robot not in fresh], schemas)))
            await self._send(fresh, announced=True, look=True)
            for message in pages:
                if not await self._deliver(gateway, message):
                    return
            await asyncio.sleep(PAUSE_S)
        await self._deliver(gateway, cluster_pb2.Mirror(whole=True).SerializeToString())

    def _whole(self, robots: Iterable[str], schemas: SentSchemas) -> Iterator[Piece]:
        now_s = self._clock.monotonic_s()
        for robot in robots:
            sent = self._sent.get(robot)
            if sent is not None:
                yield from snapshot_of(self._registry.get(robot), sent, schemas, now_s=now_s)

    async def _deliver(self, gateway: str, message: bytes) -> bool:
        """False: it is not there any more, or is behind again and gets all of it anew."""
        while gateway in self._current and gateway in self._mesh.peers():
            if self._mesh.send(gateway, MIRROR, message):
                return True
            await asyncio.sleep(FULL_S)
        return False


def _pages(pieces: Iterable[Piece]) -> Iterator[bytes]:
    """Messages that are not too large; a single piece may be."""
    page, size_bytes, texts_bytes = cluster_pb2.Mirror(), 0, 0
    for piece, texts in pieces:
        grown, texts_grown = piece.ByteSize(), sum(map(len, texts))
        if size_bytes and (size_bytes + grown > PAGE_BYTES or texts_bytes + texts_grown > TEXTS_BYTES):
            yield page.SerializeToString()
            page, size_bytes, texts_bytes = cluster_pb2.Mirror(), 0, 0
        page.schemas.extend(texts)
        page.robots.append(piece)
        size_bytes += grown
        texts_bytes += texts_grown
    if size_bytes:
        yield page.SerializeToString()
