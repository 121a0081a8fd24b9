"""Samples and bytes a second on each topic. `RateMeter` is pure, `TopicCounter` subscribes."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

from metaros.limits import LIMITS

if TYPE_CHECKING:
    import zenoh

    from metaros.wire import WireSession

__all__ = ["RateMeter", "TopicCounter", "TopicRates"]

WINDOW = 5  # looks: so that a topic of 0.5 Hz has a rate, too


class TopicRates(NamedTuple):
    """Of one topic."""

    hz: float
    bytes_per_s: float


class RateMeter:
    """Rates over the last few looks at counters that only grow."""

    def __init__(self) -> None:
        self._looks: deque[tuple[float, Mapping[str, tuple[int, int]]]] = deque(maxlen=WINDOW + 1)

    def look(self, now: float, counts: Mapping[str, tuple[int, int]]) -> dict[str, TopicRates]:
        """The rates of all topics that were ever seen; empty at the first look."""
        self._looks.append((now, counts))
        since, before = self._looks[0]
        elapsed = now - since
        if elapsed <= 0:
            return {}
        rates = {}
        for topic, (samples, size) in counts.items():
            samples_then, size_then = before.get(topic, (0, 0))
            rates[topic] = TopicRates((samples - samples_then) / elapsed, (size - size_then) / elapsed)
        return rates


class TopicCounter:
    """Counts every sample of the domain through one subscription, which no node's graph shows."""

    def __init__(self, session: WireSession) -> None:
        import zenoh

        self._by_key: dict[str, list[int]] = {}  # written by Zenoh's one receiving thread
        callback = zenoh.handlers.Callback(self._take, indirect=False)
        self._subscriber = session.check_open().declare_subscriber(f"{session.domain}/**", callback)

    def _take(self, sample: zenoh.Sample) -> None:
        key, size = str(sample.key_expr), len(sample.payload)
        entry = self._by_key.get(key)
        if entry is None:
            if len(self._by_key) < LIMITS.counted_keys:
                self._by_key[key] = [1, size]
        else:
            entry[0] += 1
            entry[1] += size

    def by_topic(self) -> dict[str, tuple[int, int]]:
        """Samples and bytes since the beginning, definitions of one type taken together."""
        from metaros.errors import MetarosError
        from metaros.wire import parse_key

        totals: dict[str, tuple[int, int]] = {}
        for key, (samples, size) in list(self._by_key.items()):
            try:
                topic = parse_key(key).topic
            except MetarosError:  # somebody else's key
                continue
            before = totals.get(topic, (0, 0))
            totals[topic] = before[0] + samples, before[1] + size
        return totals

    def close(self) -> None:
        """Stop counting."""
        self._subscriber.undeclare()  # type: ignore[no-untyped-call]
