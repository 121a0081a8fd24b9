"""Time travel on a Foxglove connection: stored messages at their own pace, from any time to now, and then live again.

A client begins live. When it pauses or seeks, its subscriptions are filled from the store instead: paused it has the
newest message of each topic at that time; playing, the messages come in the order and at the distances of their stamps,
divided by the speed. Whoever reaches the present is live again. What is read ahead is one page of each robot; a client
that takes nothing is waited for.
"""

from __future__ import annotations

import asyncio
import heapq
import math
from collections.abc import AsyncIterator, Callable, Mapping
from dataclasses import dataclass
from typing import Protocol

from gateway.api.foxglove.binary import PlaybackControl, message_head, playback_state, time_message
from gateway.domain.channel import Channel
from gateway.errors import StoreError
from gateway.history.messages import Message
from gateway.history.pages import Page, PageRequest
from gateway.history.snapshot import Snapshot
from metaros.clock import Clock
from metaros.errors import MetarosError

__all__ = ["PLAYING", "Player", "PlayerContext", "clamped_speed"]

PLAYING, PAUSED, BUFFERING = 0, 1, 2
SECOND_NS = 10**9
SLOWEST, FASTEST = 0.01, 100.0
PAGE_MESSAGES = 512
SHOWN_AGE_NS = 10 * SECOND_NS  # how old a message may be that is shown for a time; latched ones are shown at any age
NOTICE_S = 0.1  # at least so often a playing client hears what time it is
LIVE_NS = SECOND_NS  # who is no further behind the present is live again
TOGETHER = 64  # messages that are sent before others have their turn on the event loop
Wanted = Mapping[tuple[str, str], tuple[int, Channel]]  # (robot, topic) -> subscription id, channel


class History(Protocol):
    """What the player needs of the history."""

    async def read(self, request: PageRequest, /) -> Page:
        """A page of messages."""

    async def at(self, robot_id: str, topics: list[str], *, t_ns: int, max_age_ns: int) -> Snapshot:
        """The newest message of each topic at a time."""


class Out(Protocol):
    """Where messages go."""

    def binary(self, message: bytes, /) -> None:
        """One binary message."""

    async def drain(self) -> None:
        """Until there is room for more."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PlayerContext:
    """What the player needs of its connection."""

    history: History
    out: Out
    clock: Clock
    wanted: Callable[[], Wanted]  # what the client subscribes to now
    set_live: Callable[[bool], None]  # take part in live samples, or no more
    notify: Callable[[str], None]  # a note to the user; "": the one before does not hold any more


class Player:
    """Of one connection. `control` and `changed` on the event loop; `run` beside them until it is cancelled."""

    def __init__(self, context: PlayerContext, *, start_ns: int) -> None:
        """`start_ns`: from when on there is history."""
        self._context = context
        self._start_ns = start_ns
        self.live = True
        self._playing = True
        self._speed = 1.0
        self._now_ns = 0  # in history: up to when it was played
        self._turn = asyncio.Event()  # what is played is other than it was
        self._shown = False

    def control(self, asked: PlaybackControl) -> None:
        """The client pauses, plays, seeks, or goes at another speed."""
        wall_ns = self._context.clock.wall_ns()
        now_ns = wall_ns if self.live else self._now_ns
        target_ns = now_ns if asked.seek_ns is None else max(self._start_ns, asked.seek_ns)
        self._playing, self._speed = asked.play, clamped_speed(asked.speed)
        if asked.play and target_ns >= wall_ns:
            self._go_live()
        else:
            self._now_ns = min(target_ns, wall_ns)
            self._shown = not self.live and asked.seek_ns is None
            if self.live:
                self.live = False
                self._context.set_live(False)
        self._turn.set()
        self._say(did_seek=asked.seek_ns is not None, request_id=asked.request_id)

    def changed(self) -> None:
        """The client subscribes to more or less."""
        self._shown = False
        self._turn.set()

    def time_ns(self) -> int:
        """What time it is for the client."""
        return self._context.clock.wall_ns() if self.live else self._now_ns

    async def run(self) -> None:
        """Play, for ever."""
        while True:
            self._turn.clear()
            if self.live:
                await self._turn.wait()
                continue
            try:
                if not self._shown:
                    await self._show()
                if self._playing and not self._turn.is_set():
                    await self._play()
                else:
                    await self._turn.wait()
            except MetarosError as error:
                self._context.notify(f"history cannot be played now: {error}")
                self._playing = False
                self._say()
                await self._turn.wait()
                self._context.notify("")

    async def _show(self) -> None:
        """The newest message of each topic at that time."""
        self._shown = True
        wanted, t_ns = self._context.wanted(), self._now_ns
        for robot, topics in _by_robot(wanted).items():
            instant = await self._context.history.at(robot, topics, t_ns=t_ns, max_age_ns=SHOWN_AGE_NS)
            for message in sorted(instant.messages, key=lambda item: item.stamp_ns):
                if self._turn.is_set():
                    return
                self._send(message, wanted)
                await self._context.out.drain()
        self._context.out.binary(time_message(t_ns))

    async def _play(self) -> None:
        """From where it is until something changes, or it is live."""
        wanted, clock = self._context.wanted(), self._context.clock
        began_s, began_ns, reported_s = clock.monotonic_s(), self._now_ns, -math.inf

        def pace_ns() -> int:
            return began_ns + round((clock.monotonic_s() - began_s) * self._speed * SECOND_NS)

        def pass_time(to_ns: int) -> None:
            nonlocal reported_s
            self._now_ns = max(self._now_ns, to_ns)
            if clock.monotonic_s() - reported_s >= NOTICE_S:
                reported_s = clock.monotonic_s()
                self._context.out.binary(time_message(self._now_ns))

        end_ns = clock.wall_ns()
        sent = 0
        async for message in self._messages(wanted, began_ns + 1, end_ns):
            while (wait_ns := message.stamp_ns - pace_ns()) > 0:
                pass_time(pace_ns())
                if await self._pause(min(NOTICE_S, wait_ns / SECOND_NS / self._speed)):
                    return
            await self._context.out.drain()
            if (sent := sent + 1) % TOGETHER == 0:
                await asyncio.sleep(0)
            if self._turn.is_set():
                return
            pass_time(message.stamp_ns)
            self._send(message, wanted)
        while (now_ns := pace_ns()) < end_ns:
            pass_time(now_ns)
            if await self._pause(NOTICE_S):
                return
        self._now_ns = end_ns
        if clock.wall_ns() - end_ns < LIVE_NS:
            self._go_live()
            self._say()

    async def _pause(self, seconds: float) -> bool:
        """Wait, and say whether something changed meanwhile."""
        try:
            async with asyncio.timeout(seconds):
                await self._turn.wait()
        except TimeoutError:
            return False
        return True

    async def _messages(self, wanted: Wanted, start_ns: int, end_ns: int) -> AsyncIterator[Message]:
        """What is stored of the range, of all robots in order of the stamps."""
        heap: list[tuple[int, int, Message, AsyncIterator[Message]]] = []
        for number, (robot, topics) in enumerate(_by_robot(wanted).items()):
            stream = self._of_robot(robot, topics, start_ns, end_ns)
            async for first in stream:
                heapq.heappush(heap, (first.stamp_ns, number, first, stream))
                break
        while heap:
            _, number, message, stream = heap[0]
            yield message
            following = await anext(stream, None)
            if following is None:
                heapq.heappop(heap)
            else:
                heapq.heapreplace(heap, (following.stamp_ns, number, following, stream))

    async def _of_robot(self, robot: str, topics: list[str], start_ns: int, end_ns: int) -> AsyncIterator[Message]:
        """Page by page: while one is played, nothing more is read."""
        after = None
        while True:
            asked = PageRequest(
                robot_id=robot,
                topics=tuple(topics),
                start_ns=start_ns,
                end_ns=end_ns,
                limit=PAGE_MESSAGES,
                after=after,
            )
            page = await self._context.history.read(asked)
            for message in page.messages:
                yield message
            if page.next is None:
                return
            if not page.messages:
                raise StoreError("a page of history has nothing and goes on")
            after = page.messages[-1].place

    def _send(self, message: Message, wanted: Wanted) -> None:
        """Under the client's subscription, if it is of the very type that was advertised."""
        found = wanted.get((message.channel.robot, message.channel.topic))
        if found is None or _form(found[1]) != _form(message.channel):
            return
        self._context.out.binary(message_head(found[0], message.stamp_ns) + message.payload)

    def _go_live(self) -> None:
        self._playing, self._speed = True, 1.0
        if not self.live:
            self.live = True
            self._context.set_live(True)

    def _say(self, *, did_seek: bool = False, request_id: str = "") -> None:
        status = PLAYING if self._playing else PAUSED
        state = playback_state(status, self.time_ns(), self._speed, did_seek=did_seek, request_id=request_id)
        self._context.out.binary(state)


def clamped_speed(speed: float) -> float:
    """A speed that can be played; 1 for what is none."""
    return min(max(SLOWEST, speed), FASTEST) if math.isfinite(speed) and speed > 0 else 1.0


def _by_robot(wanted: Wanted) -> dict[str, list[str]]:
    found: dict[str, list[str]] = {}
    for robot, topic in wanted:
        found.setdefault(robot, []).append(topic)
    return found


def _form(channel: Channel) -> tuple[str, str, str]:
    return channel.encoding, channel.schema_name, channel.type_hash
