"""Telling robots what viewers want of them now, robot by robot, so that a large fleet never holds the loop up."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterable, Mapping, Sequence

from gateway.domain.channel import LIVE, Channel
from gateway.live.demand import DemandBook, merge_rates
from gateway.live.hub import Hub
from metaros._proto import link_pb2
from metaros.clock import Clock

__all__ = ["DemandDesk"]

RELEASE_S = 0.25  # how often it is looked whether less is wanted for long enough

Send = Callable[[str, link_pb2.GatewayFrame], None]
Others = Callable[[str], Mapping[str, float]]


class DemandDesk:
    """Lives on the event loop. `channels_of` gives the channels of a robot that is online, None for one that is not."""

    def __init__(
        self,
        hub: Hub,
        *,
        online: Callable[[], Iterable[str]],
        channels_of: Callable[[str], Sequence[Channel] | None],
        send: Send,
        clock: Clock,
    ) -> None:
        self._hub = hub
        self._online = online
        self._channels_of = channels_of
        self._send = send
        self._clock = clock
        self._book = DemandBook()
        self._revision = 0
        self._stale: set[str] = set()
        self._stirred = asyncio.Event()
        self.others: Others = lambda robot: {}  # what viewers at other gateways want of a robot: topic -> rate
        hub.on_interest = self.interests_changed

    def told(self, robot_id: str) -> dict[str, float]:
        """What the robot was told last: topic -> rate (0: every sample)."""
        return self._book.told(robot_id)

    def interests_changed(self) -> None:
        """Viewers want more, or less."""
        self._stale.update(self._online())
        self._stirred.set()

    def wants_changed(self, robot_id: str) -> None:
        """Viewers at other gateways want more of a robot, or less."""
        self._stale.add(robot_id)
        self._stirred.set()

    def channels_changed(self, robot_id: str) -> None:
        """A robot announced something."""
        self._stale.add(robot_id)
        self._stirred.set()
        self._hub.channels_changed(robot_id)

    def link_changed(self, robot_id: str) -> None:
        """A robot's link is new, or gone: it was told nothing."""
        self._book.forget(robot_id)
        self.channels_changed(robot_id)

    async def run(self) -> None:
        """Tell for ever."""
        while True:
            try:
                async with asyncio.timeout(RELEASE_S):
                    await self._stirred.wait()
            except TimeoutError:
                pass
            self._stirred.clear()
            stale, self._stale = self._stale, set()
            for robot_id in {*stale, *self._book.releasing()}:
                self._tell(robot_id)
                await asyncio.sleep(0)

    def _tell(self, robot_id: str) -> None:
        channels = self._channels_of(robot_id)
        if channels is None:
            return
        live, now_s = [channel for channel in channels if channel.delivery == LIVE], self._clock.monotonic_s()
        self._book.want(robot_id, self._wanted(robot_id, live), now_s=now_s)
        demand = self._book.due(robot_id, now_s=now_s)
        if demand is None:
            return
        self._revision += 1
        entries = [
            link_pb2.DemandEntry(channel_id=channel.channel_id, max_rate_hz=demand[channel.topic])
            for channel in live
            if channel.topic in demand
        ]
        frame = link_pb2.Demand(revision=self._revision, entries=entries)
        self._send(robot_id, link_pb2.GatewayFrame(demand=frame))

    def _wanted(self, robot_id: str, live: Sequence[Channel]) -> dict[str, float]:
        """What is wanted of a robot's live channels, here and elsewhere."""
        wanted, others = self._hub.wanted(live), self.others(robot_id)
        for channel in live if others else ():
            rate = others.get(channel.topic)
            if rate is not None and channel.forward:
                known = wanted.get(channel.topic)
                wanted[channel.topic] = rate if known is None else merge_rates((rate, known))
        return wanted
