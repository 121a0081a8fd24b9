"""The hub: every arriving sample to every viewer that wants it, without ever waiting for one of them.

Samples are taken in as they come and go out once a tick: the first after a pause at once, a stream of them as one block
per channel and kind of subscription. A block is made into bytes once per encoding; a viewer costs one write of them.
"""

from __future__ import annotations

import asyncio
import heapq
from collections.abc import Callable, Iterable, Mapping
from typing import Protocol

from gateway.domain.channel import LIVE, Channel
from gateway.domain.records import Record
from gateway.domain.sample import Run
from gateway.live.demand import merge_rates
from gateway.live.encoding import Block, Encoding, view_of
from gateway.live.feeds import Feeds
from gateway.live.selection import Selection
from gateway.live.sink import Sink
from gateway.live.subscription import Identity, TopicSubscription
from gateway.live.video import VideoBlock, is_video
from gateway.live.video_selection import VideoSelection
from gateway.live.viewer import OnDropped, Viewer
from gateway.live.views import Views
from metaros.clock import Clock, SystemClock
from metaros.limits import LIMITS, Limits
from metaros.link.video_frames import Frame

__all__ = ["Hub", "Timer"]

MAX_INDEX = 65536
FOLLOWED = 16  # runs whose followed sample may still be on its way to viewers
FOLLOWED_S = 1.0


class Timer(Protocol):
    """A call that is set, and can be called off."""

    def cancel(self) -> None:
        """Call it off."""


CallLater = Callable[[float, Callable[[], None]], Timer]


class Hub:
    """Lives on the event loop. `join` adds a connection; `publish` takes samples in."""

    def __init__(
        self,
        *,
        clock: Clock | None = None,
        tick_s: float = 0.005,
        later: CallLater | None = None,
        limits: Limits = LIMITS,
    ) -> None:
        """`later` calls a function in so many seconds: the running loop's `call_later`, unless a test has another."""
        self.on_interest: Callable[[], None] = lambda: None  # somebody wants more, or less
        self.on_interest_elsewhere: Callable[[], None] = lambda: None  # the same, for robots of other gateways
        self.on_key_wanted: Callable[[str, str], None] = lambda robot, topic: None  # a viewer needs a key frame
        self.on_key_wanted_elsewhere: Callable[[str, str], None] = lambda robot, topic: None
        self.on_written: Callable[[Run], None] = lambda run: None  # of runs with a followed sample: see traces
        self._followed: list[Run] = []
        self._dropped = 0  # by subscriptions that are over
        self._followed_s = 0.0
        self._clock = clock or SystemClock()
        self._tick_s = tick_s
        self._later = later
        self._limits = limits
        self._viewers: dict[Viewer, None] = {}
        self._index: dict[Identity, dict[tuple[bool, float], Selection]] = {}
        self._channels: dict[Identity, Channel] = {}
        self._numbers: dict[Identity, int] = {}
        self._numbered = 0
        self._places: dict[TopicSubscription, list[Identity]] = {}
        self._dirty: list[Selection] = []
        self._due: list[tuple[float, int, Selection]] = []
        self._pushed = 0
        self._flushed_s = float("-inf")
        self._next_s = float("inf")  # when the next flush is set for
        self._timer: Timer | None = None
        self._feeds: dict[Feeds, Callable[[], None]] = {}
        self._watchers: dict[Callable[[str], None], None] = {}
        self._views = Views(self._deliver_viewed)

    @property
    def viewers(self) -> int:
        """How many viewers are connected."""
        return len(self._viewers)

    @property
    def waiting_bytes(self) -> int:
        """Samples that wait for viewers who do not keep up."""
        return sum(viewer.size_bytes for viewer in self._viewers)

    @property
    def dropped(self) -> int:
        """Samples that such viewers have lost since the start."""
        return self._dropped + sum(subscription.dropped for subscription in self._places)

    @property
    def feeding(self) -> bool:
        """Whether somebody looks at values of series."""
        return any(feeds.wants_values for feeds in self._feeds)

    @property
    def subscriptions(self) -> list[TopicSubscription]:
        """What all viewers have subscribed to."""
        return list(self._places)

    def join(self, sink: Sink, *, on_dropped: OnDropped | None = None) -> Viewer:
        """A connection opened: what it subscribes to goes to `sink`. Close the viewer at its end."""
        viewer = Viewer(self, sink, on_dropped=on_dropped, limits=self._limits)
        self._viewers[viewer] = None
        return viewer

    def publish(self, run: Run) -> None:
        """Samples arrived: they go out with the next tick. Payloads are copied once, for all."""
        selections = self._selections(run.channel)
        if not selections:
            return
        if run.trace is not None:
            self._followed = [*self._followed, run][-FOLLOWED:]
            self._followed_s = self._clock.monotonic_s()
        only_newest = run.count > 1 and not is_video(run.channel) and all(latest for latest, _ in selections)
        records = _records(run, only_newest=only_newest)
        for selection in selections.values():
            if selection.offer(records):
                self._dirty.append(selection)
        if self._dirty:
            self._schedule(self._flushed_s + self._tick_s)

    def feed(self, feeds: Feeds, wake: Callable[[], None]) -> Callable[[], None]:
        """Give a connection's JSON subscriptions what they want, and wake its sender; returns what ends that."""
        self._feeds[feeds] = wake

        def stop() -> None:
            self._feeds.pop(feeds, None)

        return stop

    def values(self, robot: str, values: Mapping[str, tuple[int, float]]) -> None:
        """New values of series."""
        for feeds, wake in self._feeds.items():
            if feeds.offer(robot, values):
                wake()

    def wanted(self, channels: Iterable[Channel]) -> dict[str, float]:
        """What is wanted of a robot's live channels now: topic -> rate (0: every sample)."""
        wanted: dict[str, float] = {}
        for channel in channels:
            if channel.delivery == LIVE and channel.forward:
                rates = [rate for _, rate in self._selections(channel)]
                if rates:
                    wanted[channel.topic] = merge_rates(rates)
        return wanted

    def viewer_count(self, channel: Channel) -> int:
        """How many subscriptions there are to a channel."""
        selections = self._index.get(channel.identity, {}).values()
        return sum(len(members) for selection in selections for members in selection.groups.values())

    def number_of(self, channel: Channel) -> int:
        """A number for the channel that all connections of this gateway may use, so that they share what they get."""
        number = self._numbers.get(channel.identity)
        if number is None:
            if len(self._numbers) >= MAX_INDEX:
                del self._numbers[next(iter(self._numbers))]
            self._numbered += 1
            number = self._numbers[channel.identity] = self._numbered
        return number

    def watch_channels(self, callback: Callable[[str], None]) -> Callable[[], None]:
        """Be told, by its id, of every robot whose channels or presence changed; returns what ends that."""
        self._watchers[callback] = None

        def stop() -> None:
            self._watchers.pop(callback, None)

        return stop

    def channels_changed(self, robot: str) -> None:
        """A robot's channels or its presence changed."""
        for callback in list(self._watchers):
            callback(robot)

    def flush(self) -> None:
        """Send what waits and is due; the tick calls it."""
        now_s = self._flushed_s = self._clock.monotonic_s()
        self._next_s, self._timer = float("inf"), None
        self._views.begin()
        ready, self._dirty = self._dirty, []
        while self._due and self._due[0][0] <= now_s:
            ready.append(heapq.heappop(self._due)[2])
        for selection in ready:
            due_s = selection.due_s(now_s)
            if due_s > now_s:
                self._pushed += 1
                heapq.heappush(self._due, (due_s, self._pushed, selection))
                continue
            for block in selection.take(now_s):
                self._send(selection, block)
        if self._due:
            self._schedule(max(self._due[0][0], now_s + self._tick_s))
        if self._followed and now_s - self._followed_s > FOLLOWED_S:
            self._followed = []

    def close(self) -> None:
        """Stop the thread that makes slow views."""
        self._views.close()

    def passes(self, viewer: Viewer, subscription: TopicSubscription, block: Block) -> bool:
        """Whether a block may go out to a viewer that has room; where a key frame is needed for that, ask for one."""
        if not isinstance(block, VideoBlock):
            return True
        video_cursor = subscription.video_cursor(block.channel)
        if not video_cursor.lacks(block):
            return True
        self._ask_key(subscription, block.channel)
        if block.frame is Frame.ALONE:
            return True
        if video_cursor.began:
            viewer.lost(subscription, len(block.records))
        return False

    def now_s(self) -> float:
        """The time, seconds that never run backwards."""
        return self._clock.monotonic_s()

    def later(self, delay_s: float, call: Callable[[], None]) -> Timer:
        """Call in so many seconds."""
        if self._later is None:
            self._later = asyncio.get_running_loop().call_later
        return self._later(delay_s, call)

    def added(self, viewer: Viewer, subscription: TopicSubscription) -> None:
        """A viewer's subscription began."""
        self._places[subscription] = []
        for identity, channel in self._channels.items():
            self._place(identity, channel, viewer, subscription)
        self._interest()

    def removed(self, viewer: Viewer, subscription: TopicSubscription) -> None:
        """A viewer's subscription is over."""
        self._dropped += subscription.dropped if subscription in self._places else 0
        for identity in self._places.pop(subscription, ()):
            selections = self._index.get(identity, {})
            for key, selection in list(selections.items()):
                selection.discard(viewer, subscription)
                if not selection.groups:
                    del selections[key]
        self._interest()

    def left(self, viewer: Viewer) -> None:
        """A connection ended."""
        self._viewers.pop(viewer, None)

    def _interest(self) -> None:
        self.on_interest()
        self.on_interest_elsewhere()

    def _send(self, selection: Selection, block: Block) -> None:
        for encoding in list(selection.groups):
            if view_of(encoding) is None:
                self._deliver(selection, block, encoding)
            else:
                self._views.make(selection, block, encoding)

    def _deliver_video(self, selection: Selection, block: Block, encoding: Encoding) -> None:
        """Each viewer by itself: they do not all stand at the same frame."""
        data = block.encoded(encoding)
        for viewer, subscription in selection.groups[encoding]:
            write = viewer.write
            if write is None:
                viewer.hold(subscription, block, encoding)
            elif self.passes(viewer, subscription, block):
                write(data)

    def _ask_key(self, subscription: TopicSubscription, channel: Channel) -> None:
        if subscription.video_cursor(channel).may_ask(self._clock.monotonic_s()):
            self.on_key_wanted(channel.robot, channel.topic)
            self.on_key_wanted_elsewhere(channel.robot, channel.topic)

    def _deliver_viewed(self, selection: Selection, block: Block, encoding: Encoding) -> None:
        if encoding in selection.groups:
            self._deliver(selection, block, encoding)

    def _deliver(self, selection: Selection, block: Block, encoding: Encoding) -> None:
        """The hot loop: once per block and viewer, whose objects are in no cache any more since the last tick."""
        if isinstance(block, VideoBlock):
            self._deliver_video(selection, block, encoding)
        else:
            data = block.encoded(encoding)
            for viewer, subscription in selection.groups[encoding]:
                write = viewer.write
                if write is not None:
                    write(data)
                else:
                    viewer.hold(subscription, block, encoding)
        for run in self._followed:
            if run.channel.identity == block.channel.identity and _holds(block, run):
                self.on_written(run)

    def _schedule(self, when_s: float) -> None:
        if when_s >= self._next_s:
            return
        self._next_s = when_s
        if self._timer is not None:
            self._timer.cancel()
        self._timer = self.later(max(0.0, when_s - self._clock.monotonic_s()), self.flush)

    def _selections(self, channel: Channel) -> dict[tuple[bool, float], Selection]:
        identity = channel.identity
        selections = self._index.get(identity)
        if selections is None:
            if len(self._index) >= MAX_INDEX:
                self._forget(next(iter(self._index)))
            selections = self._index[identity] = {}
            self._channels[identity] = channel
            for viewer in self._viewers:
                for subscription in viewer.topics:
                    self._place(identity, channel, viewer, subscription)
        return selections

    def _place(self, identity: Identity, channel: Channel, viewer: Viewer, subscription: TopicSubscription) -> None:
        if not subscription.wants(channel):
            return
        key = (subscription.latest, subscription.max_rate_hz)
        selection = self._index[identity].get(key)
        if selection is None:
            kind = VideoSelection if is_video(channel) else Selection
            selection = kind(channel, latest=subscription.latest, rate_hz=subscription.max_rate_hz)
            self._index[identity][key] = selection
        selection.add(viewer, subscription, subscription.encoding(channel))
        self._places[subscription].append(identity)
        if is_video(channel):
            self._ask_key(subscription, channel)

    def _forget(self, identity: Identity) -> None:
        """The oldest channel makes room; whoever wants it finds it again with its next sample."""
        del self._index[identity], self._channels[identity]


def _holds(block: Block, run: Run) -> bool:
    """Whether the run's followed sample is in the block."""
    return run.trace is not None and any(record.seq == run.trace.seq for record in block.records)


def _records(run: Run, *, only_newest: bool) -> list[Record]:
    columns, receive_ns = run.columns, run.receive_ns
    if only_newest:
        columns = columns.after(columns.count - 1)
    payload = bytes(columns.payload)  # the same object where it is that already, as is the whole of it below
    bounds = columns.offsets.tolist()
    return [
        Record(seq, stamp_ns, receive_ns, payload[start:end])
        for seq, (stamp_ns, start, end) in enumerate(
            zip(columns.stamps_ns.tolist(), bounds, bounds[1:], strict=False), columns.first_seq
        )
    ]
