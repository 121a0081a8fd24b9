"""One stream connection without its socket: subscriptions, what waits, and the messages of the next write. Pure.

All waiting samples of a viewer together are bounded by `max_bytes`; over that, the fullest subscription drops its
oldest. A drop is told to the client; replacing a waiting sample in mode "latest" is no drop.
"""

from __future__ import annotations

from typing import Any

import orjson

from gateway.domain.channel import Channel
from gateway.domain.records import Record, introduction, record_parts
from gateway.errors import InvalidRequestError, TooManyError
from gateway.live.feeds import FleetSubscription, MetricSubscription
from gateway.live.subscription import TopicSubscription
from metaros.limits import LIMITS, Limits

__all__ = ["Viewer"]

WRITE_BYTES = 256 * 1024  # one binary frame, or one record if that is larger
DROP_NOTICE_S = 0.5

Subscription = TopicSubscription | MetricSubscription | FleetSubscription


class Viewer:
    """Owned by one connection, filled by the hub."""

    def __init__(self, *, limits: Limits = LIMITS) -> None:
        self._limits = limits
        self._topics: dict[int, TopicSubscription] = {}
        self._metrics: dict[int, MetricSubscription] = {}
        self._fleet: dict[int, FleetSubscription] = {}
        self._numbers: dict[tuple[str, str, str, str, str, bytes], int] = {}
        self._untold: list[dict[str, Any]] = []
        self._size_bytes = 0
        self._notice_s = 0.0

    @property
    def size_bytes(self) -> int:
        """Bytes of samples waiting."""
        return self._size_bytes

    @property
    def topics(self) -> list[TopicSubscription]:
        """Its topic subscriptions."""
        return list(self._topics.values())

    @property
    def metrics(self) -> list[MetricSubscription]:
        """Its metric subscriptions."""
        return list(self._metrics.values())

    def add(self, subscription: Subscription) -> None:
        """Start a subscription; its number must be free."""
        count = len(self._topics) + len(self._metrics) + len(self._fleet)
        if count >= self._limits.subscriptions_per_viewer:
            raise TooManyError(f"a connection has at most {self._limits.subscriptions_per_viewer} subscriptions")
        if any(subscription.number in table for table in (self._topics, self._metrics, self._fleet)):
            raise InvalidRequestError(f"id {subscription.number} is in use on this connection")
        if isinstance(subscription, TopicSubscription):
            self._topics[subscription.number] = subscription
        elif isinstance(subscription, MetricSubscription):
            self._metrics[subscription.number] = subscription
        else:
            self._fleet[subscription.number] = subscription

    def remove(self, number: int) -> None:
        """End a subscription and forget what waits for it."""
        ended = self._topics.pop(number, None)
        if ended is not None:
            self._size_bytes -= ended.size_bytes
        elif self._metrics.pop(number, None) is None and self._fleet.pop(number, None) is None:
            raise InvalidRequestError(f"there is no subscription {number} on this connection")

    def offer(self, subscription: TopicSubscription, channel: Channel, record: Record) -> None:
        """A sample for one of its subscriptions."""
        number = self._numbers.get(channel.identity)
        if number is None:
            number = self._introduce(channel)
        self._size_bytes += subscription.offer(number, record)
        while self._size_bytes > self._limits.viewer_queue_bytes:
            fullest = max(self._topics.values(), key=lambda item: item.size_bytes)
            freed = fullest.drop_oldest()
            if not freed:
                break
            self._size_bytes -= freed

    def take(self, now_s: float) -> list[str | bytes]:
        """Messages to write now: texts, then at most one binary frame. Ask again until it is empty."""
        frame = self._frame(now_s)
        texts = [*self._untold, *self._notices(now_s)]
        self._untold = []
        for metric in self._metrics.values():
            texts += metric.take(now_s)
        for fleet in self._fleet.values():
            texts += fleet.take(now_s)
        messages: list[str | bytes] = [orjson.dumps(text).decode() for text in texts]
        return [*messages, frame] if frame else messages

    def due_s(self) -> float | None:
        """When there will be something to write; None: not before something arrives."""
        dues = [item.due_s() for table in (self._topics, self._metrics, self._fleet) for item in table.values()]
        if any(item.dropped > item.reported for item in self._topics.values()):
            dues.append(self._notice_s)
        known = [due_s for due_s in dues if due_s is not None]
        return 0.0 if self._untold else min(known, default=None)

    def _frame(self, now_s: float) -> bytes:
        """Records of all subscriptions in turn, up to WRITE_BYTES."""
        parts: list[bytes] = []
        size_bytes = 0
        turn = list(self._topics.values())
        while turn and size_bytes < WRITE_BYTES:
            still = []
            for subscription in turn:
                entry = subscription.take(now_s)
                if entry is None:
                    continue
                channel, record = entry
                parts += record_parts(record, subscription=subscription.number, channel=channel)
                size_bytes += record.size_bytes
                still.append(subscription)
                if size_bytes >= WRITE_BYTES:
                    break
            turn = still
        self._size_bytes -= size_bytes
        # The first in turn goes last next time, so that no subscription starves the others.
        if size_bytes >= WRITE_BYTES and self._topics:
            first = next(iter(self._topics))
            self._topics[first] = self._topics.pop(first)
        return b"".join(parts)

    def _notices(self, now_s: float) -> list[dict[str, Any]]:
        if now_s < self._notice_s:
            return []
        notices = []
        for item in self._topics.values():
            if item.dropped > item.reported:
                count = item.dropped - item.reported
                notices.append({"op": "dropped", "id": item.number, "count": count, "total": item.dropped})
                item.reported = item.dropped
                self._notice_s = now_s + DROP_NOTICE_S
        return notices

    def _introduce(self, channel: Channel) -> int:
        number = self._numbers[channel.identity] = len(self._numbers) + 1
        self._untold.append(introduction(channel, number))
        return number
