"""One viewer: its topic subscriptions, its sink, and what waits while the sink takes nothing. Pure but for the sink.

All waiting samples of a viewer together are bounded by `viewer_queue_bytes`; over that, the fullest subscription drops
its oldest. A drop is reported; replacing a waiting sample in mode "latest" is no drop.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from gateway.errors import InvalidRequestError, TooManyError
from gateway.live.encoding import Block, Encoding
from gateway.live.sink import Sink
from gateway.live.subscription import TopicSubscription
from metaros.limits import LIMITS, Limits

__all__ = ["OnDropped", "Viewer"]

DROP_NOTICE_S = 0.5

OnDropped = Callable[[int, int, int], None]  # the subscription's number, how many were lost since, how many ever


class ViewerHub(Protocol):
    """What a viewer needs of its hub."""

    def added(self, viewer: Viewer, subscription: TopicSubscription, /) -> None:
        """A subscription began."""

    def removed(self, viewer: Viewer, subscription: TopicSubscription, /) -> None:
        """A subscription is over."""

    def left(self, viewer: Viewer, /) -> None:
        """The viewer is gone."""

    def passes(self, viewer: Viewer, subscription: TopicSubscription, block: Block, /) -> bool:
        """Whether a block may go out now: of video only what can be decoded after what went out before."""

    def now_s(self) -> float:
        """The time, seconds that never run backwards."""

    def later(self, delay_s: float, call: Callable[[], None], /) -> object:
        """Call in so many seconds."""


class Viewer:
    """Owned by one connection; the hub writes to its sink, or lets what it would write wait here."""

    def __init__(
        self, hub: ViewerHub, sink: Sink, *, on_dropped: OnDropped | None = None, limits: Limits = LIMITS
    ) -> None:
        self.write: Callable[[bytes], None] | None = None  # where what comes goes straight to; None: it has to wait
        self.size_bytes = 0  # of samples that wait
        self._hub = hub
        self._sink = sink
        self._on_dropped = on_dropped
        self._limits = limits
        self._topics: dict[int, TopicSubscription] = {}
        self._closed = False
        self._notice_s = 0.0
        self._notice_set = False
        sink.on_full, sink.on_drained = self._wait, self.drain
        if sink.ready():
            self.write = sink.write

    @property
    def clear(self) -> bool:
        """Whether nothing waits."""
        return self.write is not None

    @property
    def topics(self) -> list[TopicSubscription]:
        """Its topic subscriptions."""
        return list(self._topics.values())

    def subscribe(self, subscription: TopicSubscription) -> None:
        """Start a subscription; its number must be free."""
        if len(self._topics) >= self._limits.subscriptions_per_viewer:
            raise TooManyError(f"a connection has at most {self._limits.subscriptions_per_viewer} subscriptions")
        if subscription.number in self._topics:
            raise InvalidRequestError(f"id {subscription.number} is in use on this connection")
        self._topics[subscription.number] = subscription
        self._hub.added(self, subscription)

    def unsubscribe(self, number: int) -> None:
        """End a subscription and forget what waits for it."""
        ended = self._topics.pop(number, None)
        if ended is None:
            raise InvalidRequestError(f"there is no subscription {number} on this connection")
        self.size_bytes -= ended.size_bytes
        self._hub.removed(self, ended)

    def close(self) -> None:
        """The connection is over; more than once does nothing."""
        if self._closed:
            return
        self._closed = True
        for subscription in self._topics.values():
            self._hub.removed(self, subscription)
        self._topics.clear()
        self._hub.left(self)

    def hold(self, subscription: TopicSubscription, block: Block, encoding: Encoding) -> None:
        """The sink takes nothing now: let a block wait, and the oldest go where that is too much."""
        if self._topics.get(subscription.number) is not subscription:
            return
        self.write = None
        self.size_bytes += subscription.hold(block, encoding)
        while self.size_bytes > self._limits.viewer_queue_bytes:
            freed = max(self._topics.values(), key=lambda item: item.size_bytes).drop_oldest()
            if not freed:
                break
            self.size_bytes -= freed

    def lost(self, subscription: TopicSubscription, count: int) -> None:
        """So many samples were given up before they came here."""
        subscription.dropped += count
        if self.clear:
            self._report_drops()

    def drain(self) -> None:
        """The sink has room: write what waits, subscription by subscription in turn, while it takes it."""
        sink = self._sink
        while not self.clear and sink.ready():
            wrote = False
            for number, subscription in list(self._topics.items()):
                if not sink.ready():
                    break
                found = subscription.take()
                if found is None:
                    continue
                wrote = True
                block, encoding = found
                self.size_bytes -= block.size_bytes
                if self._hub.passes(self, subscription, block):
                    sink.write(block.encoded(encoding))
                self._topics[number] = self._topics.pop(number)  # it goes last next time: none starves the others
            if not wrote and sink.ready():
                self.write = sink.write  # nothing waits any more
        self._report_drops()

    def _wait(self) -> None:
        self.write = None

    def _report_drops(self) -> None:
        """Say what was lost, twice a second at most."""
        lossy = [item for item in self._topics.values() if item.dropped > item.reported]
        if not lossy or self._on_dropped is None:
            return
        now_s = self._hub.now_s()
        if now_s < self._notice_s:
            if not self._notice_set:
                self._notice_set = True
                self._hub.later(self._notice_s - now_s, self._report_drops_later)
            return
        self._notice_s = now_s + DROP_NOTICE_S
        for item in lossy:
            count, item.reported = item.dropped - item.reported, item.dropped
            self._on_dropped(item.number, count, item.dropped)

    def _report_drops_later(self) -> None:
        self._notice_set = False
        if not self._closed:
            self._report_drops()
