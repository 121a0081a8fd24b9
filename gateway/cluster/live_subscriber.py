"""Viewers here of robots that are linked elsewhere: homes are told what is wanted, and what comes is published."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Iterable, Iterator, Mapping
from itertools import islice
from typing import Final

from google.protobuf.message import DecodeError

from gateway.cluster.interest import InterestBook
from gateway.cluster.live_home import INTEREST, KEYS, LIVE
from gateway.cluster.ports import Mesh
from gateway.domain.channel import Channel
from gateway.domain.sample import Run
from gateway.ingest.registry import Registry
from gateway.live.hub import Hub
from gateway.live.subscription import TopicSubscription
from metaros._proto import cluster_pb2
from metaros.errors import FrameError
from metaros.link import unpack_batch

__all__ = ["LiveAway"]

log = logging.getLogger(__name__)

SOON_S: Final = 0.02  # what is wanted anew within so long is told together
AGAIN_S: Final = 0.1  # until it is tried again where so much waited that it was not sent
AT_ONCE: Final = 32  # robots that are asked about, before others have their turn on the event loop
PAGE: Final = 256  # robots in one message

Wants = dict[str, float]


class LiveAway:
    """All methods on the event loop; `run` it beside the hub."""

    def __init__(self, mesh: Mesh, registry: Registry, hub: Hub) -> None:
        self.received = 0
        self.stale = 0  # samples of channels that are not known any more, or not yet
        self._mesh = mesh
        self._registry = registry
        self._hub = hub
        self._book = InterestBook()
        self._known: dict[TopicSubscription, None] = {}
        self._moved: dict[str, None] = {}  # robots whose home or channels are news
        self._due: dict[str, None] = {}  # robots of which other things are wanted
        self._told: dict[str, dict[str, Wants]] = {}  # by gateway and robot
        self._fresh: set[str] = set()  # gateways that were told nothing yet
        self._stirred = asyncio.Event()
        hub.on_interest_elsewhere = self._stirred.set
        hub.on_key_wanted_elsewhere = self._want_key
        mesh.on_tell(LIVE, self._on_samples)
        mesh.on_peer(self._on_peer)

    def on_home(self, robot: str) -> None:
        """A robot's home or its channels are others than before."""
        self._moved[robot] = None
        self._stirred.set()

    async def run(self) -> None:
        """Tell for ever."""
        while True:
            await self._stirred.wait()
            await asyncio.sleep(SOON_S)
            self._stirred.clear()
            await self._look()
            for gateway in list(self._told):
                await self._tell(gateway)
            self._due = {}

    async def _look(self) -> None:
        """Ask new subscriptions about all robots, and all subscriptions about robots that are news."""
        known, moved = self._known, self._moved
        self._known, self._moved = dict.fromkeys(self._hub.subscriptions), {}
        for subscription in known:
            if subscription not in self._known:
                self._due.update(dict.fromkeys(self._book.drop(subscription)))
        new = [subscription for subscription in self._known if subscription not in known]
        robots = [record.robot.id for record in self._registry.all() if record.home] if new else []
        await self._ask(new, (robot for robot in robots if robot not in moved))
        await self._ask(self._known, moved)
        self._due.update(moved)

    async def _ask(self, subscriptions: Iterable[TopicSubscription], robots: Iterable[str]) -> None:
        for position, robot in enumerate(robots):
            channels = self._channels_of(robot)
            if channels is None:
                self._book.forget(robot)
                continue
            for subscription in subscriptions:
                if self._book.ask(subscription, robot, channels):
                    self._due[robot] = None
            if position % AT_ONCE == AT_ONCE - 1:
                await asyncio.sleep(0)

    def _channels_of(self, robot: str) -> list[Channel] | None:
        """Those of a robot that is not linked here; of one that is, nothing is wanted from elsewhere."""
        record = self._registry.find(robot)
        if record is None or record.here:
            return None
        return [state.channel for state in record.channels.values()]

    async def _tell(self, gateway: str) -> None:
        """What is wanted of its robots now, where that is not what it was told."""
        told = self._told.get(gateway)
        if told is None:
            return
        changes = iter(list(self._changes(gateway, told)))
        while told is self._told.get(gateway) and (page := list(islice(changes, PAGE))):
            message = cluster_pb2.Interest(anew=gateway in self._fresh)
            for robot, wants in page:
                topics = [cluster_pb2.TopicInterest(topic=topic, max_rate_hz=rate) for topic, rate in wants.items()]
                message.robots.add(robot=robot, topics=topics)
            if not self._mesh.tell(gateway, INTEREST, message.SerializeToString()):
                self._later()
                return
            self._fresh.discard(gateway)
            for robot, wants in page:
                _note(told, robot, wants)
            await asyncio.sleep(0)

    def _changes(self, gateway: str, told: Mapping[str, Wants]) -> Iterator[tuple[str, Wants]]:
        for robot in self._due:
            record, known = self._registry.find(robot), told.get(robot, {})
            home = record.home if record is not None else ""
            here = record is not None and record.here
            gone = not home and not here  # it may be back at once: what was wanted there goes on
            wants = self._book.of(robot) if home == gateway or (gone and known) else {}
            if wants != known:
                yield robot, wants

    def _want_key(self, robot: str, topic: str) -> None:
        """Its home asks the robot. Where so much waits that this is not sent, the viewer wants it again later."""
        record = self._registry.find(robot)
        if record is not None and record.home and not record.here:
            wanted = cluster_pb2.KeyFrameWanted(robot=robot, topic=topic)
            self._mesh.tell(record.home, KEYS, wanted.SerializeToString())

    def _later(self) -> None:
        """All of what is due is looked at again."""
        self._moved.update(self._due)
        asyncio.get_running_loop().call_later(AGAIN_S, self._stirred.set)

    def _on_peer(self, gateway: str, came: bool) -> None:
        self._told.pop(gateway, None)
        self._fresh.discard(gateway)
        if came:
            self._told[gateway] = {}
            self._fresh.add(gateway)

    def _on_samples(self, sender: str, payload: bytes) -> None:
        try:
            forwarded = cluster_pb2.Forwarded.FromString(payload)
        except DecodeError:
            log.error("gateway %s forwards samples that cannot be read: is it of another version?", sender)
            return
        for told in forwarded.runs:
            run = self._run(sender, told)
            if run is None:
                self.stale += told.batch.count
            else:
                self.received += run.count
                self._hub.publish(run)

    def _run(self, sender: str, told: cluster_pb2.ForwardedRun) -> Run | None:
        """None: it is of a former home, of a process before, or of a channel that is not known yet."""
        record = self._registry.find(told.robot)
        if record is None or record.home != sender or record.generation != told.generation:
            return None
        state = record.channels.get(told.batch.stream_id)
        if state is None:
            return None
        try:
            return Run(state.channel, unpack_batch(told.batch), told.receive_ns)
        except FrameError:
            return None


def _note(told: dict[str, Wants], robot: str, wants: Wants) -> None:
    if wants:
        told[robot] = wants
    else:
        told.pop(robot, None)
