"""What health rules read, measured over sliding windows: pure, in bounded memory, with the time passed in."""

from __future__ import annotations

from typing import Final

__all__ = ["GapMeter", "RateMeter", "WindowMax"]

_BUCKETS: Final = 10  # a window moves in steps of a tenth


class _Window:
    """What happened, by bucket of time: (how many, first, last); buckets that left the window are forgotten."""

    def __init__(self, window_s: float) -> None:
        self._bucket_s = window_s / _BUCKETS
        self._buckets: dict[int, tuple[float, float, float]] = {}

    def _slot(self, now_s: float) -> int:
        """The bucket of now."""
        slot = int(now_s / self._bucket_s)
        oldest = slot - _BUCKETS
        if self._buckets and next(iter(self._buckets)) < oldest:
            self._buckets = {at: bucket for at, bucket in self._buckets.items() if at >= oldest}
        return slot


class RateMeter(_Window):
    """Events a second over the last `window_s`."""

    def tick(self, now_s: float, count: float = 1) -> None:
        """Something happened."""
        slot = self._slot(now_s)
        before, first_s, _ = self._buckets.get(slot, (0.0, now_s, now_s))
        self._buckets[slot] = (before + count, first_s, now_s)

    def count(self, now_s: float) -> float:
        """How often it happened within the window."""
        self._slot(now_s)
        return sum(count for count, _, _ in self._buckets.values())

    def rate_hz(self, now_s: float) -> float:
        """The inverse of the mean interval, the present one included as soon as it is longer than the mean.

        Not the count over the window, which jumps by one event: at 2 Hz that would be a quarter of the value.
        """
        count = self.count(now_s)
        if not count:
            return 0.0
        buckets = list(self._buckets.values())
        first_s, last_s = buckets[0][1], buckets[-1][2]
        if count == 1:
            return 1.0 / max(now_s - last_s, self._bucket_s * _BUCKETS)
        mean_s = max((last_s - first_s) / (count - 1), 1e-9)
        return 1.0 / mean_s if now_s - last_s <= mean_s else count / (now_s - first_s)


class WindowMax(_Window):
    """The greatest value of the last `window_s`; 0 without any."""

    def put(self, now_s: float, value: float) -> None:
        """One more value."""
        slot = self._slot(now_s)
        greatest = self._buckets.get(slot, (value, 0.0, 0.0))[0]
        self._buckets[slot] = (max(greatest, value), 0.0, 0.0)

    def greatest(self, now_s: float) -> float:
        """The greatest one that is still in the window."""
        self._slot(now_s)
        return max((value for value, _, _ in self._buckets.values()), default=0.0)


class GapMeter:
    """How many deadlines were missed within the last `window_s`; a silence misses one every `deadline_s`."""

    def __init__(self, deadline_s: float, window_s: float, now_s: float) -> None:
        self._deadline_s = deadline_s
        self._last_s = now_s
        self._window_s = window_s
        self._missed = RateMeter(window_s)

    def begin(self, now_s: float) -> None:
        """Forget what was; the first deadline begins now."""
        self._last_s = now_s
        self._missed = RateMeter(self._window_s)

    def tick(self, now_s: float) -> None:
        """A message came."""
        self._settle(now_s)
        self._last_s = now_s

    def missed(self, now_s: float) -> float:
        """The deadlines missed, those of the silence that still lasts among them."""
        self._settle(now_s)
        return self._missed.count(now_s)

    def _settle(self, now_s: float) -> None:
        gaps = int((now_s - self._last_s) / self._deadline_s)
        if gaps:
            self._missed.tick(now_s, gaps)
            self._last_s += gaps * self._deadline_s
