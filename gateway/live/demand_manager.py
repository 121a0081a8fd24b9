"""Sends each robot what viewers want of it, robot by robot, so that a large fleet never holds the loop up."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterable, Mapping, Sequence

from gateway.domain.channel import LIVE, Channel
from gateway.live.demand import DemandTable, merge_rates
from gateway.live.hub import Hub
from gateway.live.video import is_video
from gateway.live.video_demand import VideoDemand
from metaros._proto import link_pb2
from metaros.clock import Clock

__all__ = ["DemandManager"]

RELEASE_S = 0.25  # how often it is looked whether less is wanted for long enough

Send = Callable[[str, link_pb2.GatewayFrame], None]
Others = Callable[[str], Mapping[str, float]]


class DemandManager:
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
        self._table = DemandTable()
        self._video = VideoDemand()
        self._revision = 0
        self._stale: set[str] = set()
        self._wakeup = asyncio.Event()
        self.others: Others = lambda robot: {}  # what viewers at other gateways want of a robot: topic -> rate
        hub.on_interest = self.interests_changed
        hub.on_key_wanted = self.key_wanted

    def sent(self, robot_id: str) -> dict[str, float]:
        """What was sent to the robot last: topic -> rate (0: every sample)."""
        return self._table.sent(robot_id)

    def interests_changed(self) -> None:
        """Viewers want more, or less."""
        self._stale.update(self._online())
        self._wakeup.set()

    def wants_changed(self, robot_id: str) -> None:
        """Viewers at other gateways want more of a robot, or less."""
        self._stale.add(robot_id)
        self._wakeup.set()

    def key_wanted(self, robot_id: str, topic: str) -> None:
        """A viewer needs a key frame of a video topic of a robot that is linked here."""
        channels = self._channels_of(robot_id) or ()
        if any(channel.topic == topic and is_video(channel) for channel in channels):
            self._video.want_key(robot_id, topic)
            self.wants_changed(robot_id)

    def channels_changed(self, robot_id: str) -> None:
        """A robot announced something."""
        self._stale.add(robot_id)
        self._wakeup.set()
        self._hub.channels_changed(robot_id)

    def link_changed(self, robot_id: str) -> None:
        """A robot's link is new, or gone: nothing was sent on it."""
        self._table.forget(robot_id)
        self._video.forget(robot_id)
        self.channels_changed(robot_id)

    async def run(self) -> None:
        """Send what changed, until cancelled."""
        while True:
            try:
                async with asyncio.timeout(RELEASE_S):
                    await self._wakeup.wait()
            except TimeoutError:
                pass
            self._wakeup.clear()
            stale, self._stale = self._stale, set()
            for robot_id in {*stale, *self._table.releasing(), *self._video.waiting()}:
                self._send_demand(robot_id)
                await asyncio.sleep(0)

    def _send_demand(self, robot_id: str) -> None:
        channels = self._channels_of(robot_id)
        if channels is None:
            return
        live, now_s = [channel for channel in channels if channel.delivery == LIVE], self._clock.monotonic_s()
        self._table.want(robot_id, self._wanted(robot_id, live), now_s=now_s)
        demand = self._table.due(robot_id, now_s=now_s)
        sent = self._table.sent(robot_id)
        video = self._video.due(robot_id, self._viewers(robot_id, live, sent), now_s=now_s)
        if demand is None and video is None:
            return
        self._revision += 1
        entries = [self._entry(channel, sent[channel.topic]) for channel in live if channel.topic in sent]
        frame = link_pb2.Demand(revision=self._revision, entries=entries)
        self._send(robot_id, link_pb2.GatewayFrame(demand=frame))

    def _entry(self, channel: Channel, rate_hz: float) -> link_pb2.DemandEntry:
        viewers, key_frames = self._video.sent(channel.robot).get(channel.topic, (0, 0))
        return link_pb2.DemandEntry(
            channel_id=channel.channel_id, max_rate_hz=rate_hz, viewers=viewers, key_frames=key_frames
        )

    def _viewers(self, robot_id: str, live: Sequence[Channel], sent: Mapping[str, float]) -> dict[str, int]:
        """How many look at each video topic that is wanted; those at all other gateways count as one."""
        others = self.others(robot_id)
        return {
            channel.topic: self._hub.viewer_count(channel) + (channel.topic in others)
            for channel in live
            if channel.topic in sent and is_video(channel)
        }

    def _wanted(self, robot_id: str, live: Sequence[Channel]) -> dict[str, float]:
        """What is wanted of a robot's live channels, here and elsewhere."""
        wanted, others = self._hub.wanted(live), self.others(robot_id)
        for channel in live if others else ():
            rate = others.get(channel.topic)
            if rate is not None and channel.forward:
                known = wanted.get(channel.topic)
                wanted[channel.topic] = rate if known is None else merge_rates((rate, known))
        return wanted
