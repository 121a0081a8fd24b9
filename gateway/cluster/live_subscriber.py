"""Subscribes to remote robots for local viewers: sends their interest to the owners, publishes what arrives here."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Iterable, Iterator, Mapping
from itertools import islice
from typing import Final

from google.protobuf.message import DecodeError

from gateway.cluster.interest import InterestTable
from gateway.cluster.live_publisher import INTEREST, KEYS, LIVE
from gateway.cluster.ports import Mesh
from gateway.domain.channel import Channel
from gateway.domain.sample import Run
from gateway.ingest.registry import Registry
from gateway.live.hub import Hub
from gateway.live.subscription import TopicSubscription
from metaros._proto import cluster_pb2
from metaros.errors import FrameError
from metaros.link import unpack_batch

__all__ = ["LiveSubscriber"]

log = logging.getLogger(__name__)

SOON_S: Final = 0.02  # what is wanted anew within so long is told together
AGAIN_S: Final = 0.1  # until it is tried again where so much waited that it was not sent
AT_ONCE: Final = 32  # robots that are asked about, before others have their turn on the event loop
PAGE: Final = 256  # robots in one message

Wants = dict[str, float]


class LiveSubscriber:
    """All methods on the event loop; `run` it beside the hub."""

    def __init__(self, mesh: Mesh, registry: Registry, hub: Hub) -> None:
        self.received = 0
        self.stale = 0  # samples of channels that are not known any more, or not yet
        self._mesh = mesh
        self._registry = registry
        self._hub = hub
        self._interest = InterestTable()
        self._known: dict[TopicSubscription, None] = {}
        self._moved: dict[str, None] = {}  # robots whose owner or channels are news
        self._due: dict[str, None] = {}  # robots of which other things are wanted
        self._sent: dict[str, dict[str, Wants]] = {}  # by gateway and robot
        self._fresh: set[str] = set()  # gateways that were told nothing yet
        self._stirred = asyncio.Event()
        hub.on_interest_elsewhere = self._stirred.set
        hub.on_key_wanted_elsewhere = self._want_key
        mesh.on_message(LIVE, self._on_samples)
        mesh.on_peer(self._on_peer)

    def on_owner(self, robot: str) -> None:
        """A robot's owner or its channels are others than before."""
        self._moved[robot] = None
        self._stirred.set()

    async def run(self) -> None:
        """Send changes of interest, until cancelled."""
        while True:
            await self._stirred.wait()
            await asyncio.sleep(SOON_S)
            self._stirred.clear()
            await self._look()
            for gateway in list(self._sent):
                await self._send(gateway)
            self._due = {}

    async def _look(self) -> None:
        """Ask new subscriptions about all robots, and all subscriptions about robots that are news."""
        known, moved = self._known, self._moved
        self._known, self._moved = dict.fromkeys(self._hub.subscriptions), {}
        for subscription in known:
            if subscription not in self._known:
                self._due.update(dict.fromkeys(self._interest.drop(subscription)))
        new = [subscription for subscription in self._known if subscription not in known]
        robots = [record.robot.id for record in self._registry.all() if record.owner_gateway] if new else []
        await self._ask(new, (robot for robot in robots if robot not in moved))
        await self._ask(self._known, moved)
        self._due.update(moved)

    async def _ask(self, subscriptions: Iterable[TopicSubscription], robots: Iterable[str]) -> None:
        for position, robot in enumerate(robots):
            channels = self._channels_of(robot)
            if channels is None:
                self._interest.forget(robot)
                continue
            for subscription in subscriptions:
                if self._interest.ask(subscription, robot, channels):
                    self._due[robot] = None
            if position % AT_ONCE == AT_ONCE - 1:
                await asyncio.sleep(0)

    def _channels_of(self, robot: str) -> list[Channel] | None:
        """Those of a robot that is not linked here; of one that is, nothing is wanted from elsewhere."""
        record = self._registry.find(robot)
        if record is None or record.here:
            return None
        return [state.channel for state in record.channels.values()]

    async def _send(self, gateway: str) -> None:
        """What is wanted of its robots now, where that is not what it was told."""
        sent = self._sent.get(gateway)
        if sent is None:
            return
        changes = iter(list(self._changes(gateway, sent)))
        while sent is self._sent.get(gateway) and (page := list(islice(changes, PAGE))):
            message = cluster_pb2.Interest(anew=gateway in self._fresh)
            for robot, wants in page:
                topics = [cluster_pb2.TopicInterest(topic=topic, max_rate_hz=rate) for topic, rate in wants.items()]
                message.robots.add(robot=robot, topics=topics)
            if not self._mesh.send(gateway, INTEREST, message.SerializeToString()):
                self._later()
                return
            self._fresh.discard(gateway)
            for robot, wants in page:
                _note(sent, robot, wants)
            await asyncio.sleep(0)

    def _changes(self, gateway: str, sent: Mapping[str, Wants]) -> Iterator[tuple[str, Wants]]:
        for robot in self._due:
            record, known = self._registry.find(robot), sent.get(robot, {})
            owner = record.owner_gateway if record is not None else ""
            here = record is not None and record.here
            gone = not owner and not here  # it may be back at once: what was wanted there goes on
            wants = self._interest.of(robot) if owner == gateway or (gone and known) else {}
            if wants != known:
                yield robot, wants

    def _want_key(self, robot: str, topic: str) -> None:
        """Its owner asks the robot. Where so much waits that this is not sent, the viewer wants it again later."""
        record = self._registry.find(robot)
        if record is not None and record.owner_gateway and not record.here:
            wanted = cluster_pb2.KeyFrameWanted(robot=robot, topic=topic)
            self._mesh.send(record.owner_gateway, KEYS, wanted.SerializeToString())

    def _later(self) -> None:
        """All of what is due is looked at again."""
        self._moved.update(self._due)
        asyncio.get_running_loop().call_later(AGAIN_S, self._stirred.set)

    def _on_peer(self, gateway: str, came: bool) -> None:
        self._sent.pop(gateway, None)
        self._fresh.discard(gateway)
        if came:
            self._sent[gateway] = {}
            self._fresh.add(gateway)

    def _on_samples(self, sender: str, payload: bytes) -> None:
        try:
            forwarded = cluster_pb2.Forwarded.FromString(payload)
        except DecodeError:
            log.error("gateway %s forwards samples that cannot be read: is it of another version?", sender)
            return
        for item in forwarded.runs:
            run = self._run(sender, item)
            if run is None:
                self.stale += item.batch.count
            else:
                self.received += run.count
                self._hub.publish(run)

    def _run(self, sender: str, item: cluster_pb2.ForwardedRun) -> Run | None:
        """None: it is of a former owner, of a process before, or of a channel that is not known yet."""
        record = self._registry.find(item.robot)
        if record is None or record.owner_gateway != sender or record.generation != item.generation:
            return None
        state = record.channels.get(item.batch.stream_id)
        if state is None:
            return None
        try:
            return Run(state.channel, unpack_batch(item.batch), item.receive_ns)
        except FrameError:
            return None


def _note(sent: dict[str, Wants], robot: str, wants: Wants) -> None:
    if wants:
        sent[robot] = wants
    else:
        sent.pop(robot, None)
