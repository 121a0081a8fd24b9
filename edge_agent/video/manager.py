"""Requests to video sources on the robot: key frames, the number of viewers, and the bit rate that the link carries.

As `metaros_msgs/msg/VideoDemand` on `<topic>/demand`, for video topics of the agent's own namespace alone. A source
is notified at once when somebody joins or leaves, and again every two seconds while somebody looks.
"""

from __future__ import annotations

import asyncio
import logging
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

from edge_agent.forwarding.channel import Channel
from edge_agent.forwarding.channels import Channels
from edge_agent.forwarding.scope import Scope
from edge_agent.forwarding.video_queue import VideoQueue
from edge_agent.link.budget import Budget
from edge_agent.link.frames import ControlFrame
from edge_agent.link.handler import SendFrame
from edge_agent.video.ladder import Ladder
from metaros._proto import link_pb2
from metaros.cdr import codec
from metaros.clock import Clock
from metaros.errors import MetarosError
from metaros.idl import type_hash
from metaros.interfaces.metaros_msgs.msg import VideoDemand

__all__ = ["VideoManager"]

LOG = logging.getLogger("metaros.agent.video")
TYPE: Final = "metaros_msgs/msg/VideoDemand"
LOOK_S: Final = 0.25  # between two key frames that are asked for, too: four a second
LADDER_S: Final = 1.0
AGAIN_S: Final = 2.0
SHARE: Final = 0.7  # of the uplink's budget is for all video together
MOST_BPS: Final = 2**32 - 1

Publish = Callable[[str, str, str, bytes], None]  # topic, type, hash, CDR


@dataclass(slots=True, kw_only=True)
class _Watched:
    """A video channel that somebody looks at, and what was last requested of its source."""

    topic: str
    line: VideoQueue
    viewers: int = 1
    key_frames: int = 0
    bitrate_bps: int = 0
    ladder: Ladder = field(default_factory=Ladder)
    sent_bytes: int = 0
    measured_s: float
    key_s: float = -math.inf
    requested: tuple[int, int] = (0, 0)
    requested_s: float = -math.inf


class VideoManager:
    """See ControlHandler. `publish` is `Publishers.publish`."""

    frames = frozenset({"demand"})

    def __init__(self, channels: Channels, scope: Scope, budget: Budget, publish: Publish, clock: Clock) -> None:
        self._channels = channels
        self._scope = scope
        self._budget = budget
        self._publish = publish
        self._clock = clock
        self._hash = type_hash(TYPE)
        self._watched: dict[int, _Watched] = {}
        self._stirred = asyncio.Event()

    def link_up(self, send: SendFrame, welcome: link_pb2.Welcome) -> None:
        """See ControlHandler."""

    def link_down(self) -> None:
        """See ControlHandler."""
        self._want({})

    def take(self, received: ControlFrame) -> None:
        """See ControlHandler."""
        self._want({entry.channel_id: entry for entry in received.frame.demand.entries})

    async def run(self) -> None:
        """Until cancelled; then nobody looks."""
        try:
            while True:
                await self._stirred.wait()
                await asyncio.sleep(LOOK_S)
                self.look()
        finally:
            self._want({})

    def look(self) -> None:
        """Send every source what is new."""
        now_s = self._clock.monotonic_s()
        for watched in self._watched.values():
            if now_s - watched.measured_s >= LADDER_S:
                self._measure(watched, now_s)
            self._request(watched, now_s)

    def _want(self, entries: dict[int, link_pb2.DemandEntry]) -> None:
        """These channels are wanted from now on."""
        wanted = {number: found for number in entries if (found := self._video(number)) is not None}
        for number in [number for number in self._watched if number not in wanted]:
            self._say(self._watched.pop(number).topic, key_frame=False, viewers=0, bitrate_bps=0)
        for number, (channel, line) in wanted.items():
            self._watch(number, channel, line, entries[number])
        if self._watched:
            self._stirred.set()
        else:
            self._stirred.clear()
        self.look()

    def _watch(self, number: int, channel: Channel, line: VideoQueue, entry: link_pb2.DemandEntry) -> None:
        watched = self._watched.get(number)
        if watched is None:
            now_s = self._clock.monotonic_s()
            watched = _Watched(topic=channel.topic, line=line, sent_bytes=line.sent_bytes, measured_s=now_s)
            watched.key_frames = entry.key_frames
            self._watched[number] = watched
            line.key_wanted = True
            line.is_behind()  # what was before does not count
        elif watched.key_frames != entry.key_frames:
            watched.key_frames, line.key_wanted = entry.key_frames, True
        watched.viewers = max(1, entry.viewers)

    def _video(self, number: int) -> tuple[Channel, VideoQueue] | None:
        """The channel of that number, where it is video of this robot."""
        channel = self._channels.by_id(number)
        if channel is None or channel.video is None or not self._scope.includes(channel.topic):
            return None
        return channel, channel.video

    def _measure(self, watched: _Watched, now_s: float) -> None:
        """What the link carried of the channel, and what to ask for after that."""
        span_s = now_s - watched.measured_s
        sent_bps = 8 * (watched.line.sent_bytes - watched.sent_bytes) / span_s
        watched.sent_bytes, watched.measured_s = watched.line.sent_bytes, now_s
        most_bps = SHARE * 8 * self._budget.limit_bytes_per_s / len(self._watched)
        watched.bitrate_bps = watched.ladder.look(
            behind=watched.line.is_behind(), sent_bps=sent_bps, most_bps=most_bps, now_s=now_s
        )

    def _request(self, watched: _Watched, now_s: float) -> None:
        """A key frame where one is wanted and the last is long enough ago; what changed; the same again in time."""
        key_frame = watched.line.key_wanted and now_s - watched.key_s >= LOOK_S
        state = (watched.viewers, watched.bitrate_bps)
        if not key_frame and state == watched.requested and now_s - watched.requested_s < AGAIN_S:
            return
        if key_frame:
            watched.line.key_wanted, watched.key_s = False, now_s
        watched.requested, watched.requested_s = state, now_s
        self._say(watched.topic, key_frame=key_frame, viewers=watched.viewers, bitrate_bps=watched.bitrate_bps)

    def _say(self, topic: str, *, key_frame: bool, viewers: int, bitrate_bps: int) -> None:
        demand = VideoDemand(key_frame=key_frame, viewers=viewers, bitrate_bps=min(bitrate_bps, MOST_BPS))
        try:
            self._publish(f"{topic}/demand", TYPE, self._hash, codec(TYPE).encode(demand))
        except MetarosError as error:  # such as a name that is too long with the /demand behind it
            LOG.warning("cannot send the request to the source of %s: %s", topic, error)
