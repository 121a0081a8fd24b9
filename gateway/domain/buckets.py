"""Token buckets by key, a bounded number of them. Pure: callers pass the time."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Hashable

__all__ = ["TokenBuckets"]

MOST = 65_536


class TokenBuckets:
    """One rate for many: each key may take `per_s` tokens a second, and `burst` at once after a rest.

    A bucket that is full again is forgotten. Where there are too many, the one that was used longest ago goes: for
    its owner it is as if it were full, so that nobody is refused for what others do.
    """

    def __init__(self, *, per_s: float, burst: float, most: int = MOST) -> None:
        """`per_s` of 0 means no limit."""
        self._per_s = per_s
        self._burst = burst
        self._most = most
        self._levels: OrderedDict[Hashable, tuple[float, float]] = OrderedDict()  # what was left, and when

    def __len__(self) -> int:
        return len(self._levels)

    def wait_s(self, key: Hashable, now_s: float, amount: float = 1.0) -> float:
        """How long until so much may be taken; 0: now. More than `burst` at once is as much as `burst`."""
        if not self._per_s:
            return 0.0
        return max(0.0, (min(amount, self._burst) - self._level(key, now_s)) / self._per_s)

    def take(self, key: Hashable, now_s: float, amount: float = 1.0) -> float:
        """Take so much and say 0, or take nothing and say how many seconds are to be waited."""
        wait_s = self.wait_s(key, now_s, amount)
        if self._per_s and not wait_s:
            self._put(key, self._level(key, now_s) - amount, now_s)
        return wait_s

    def drop(self, key: Hashable, now_s: float, amount: float = 1.0) -> None:
        """Take so much whether it is there or not; a debt is at most four bursts."""
        if self._per_s:
            self._put(key, max(-4 * self._burst, self._level(key, now_s) - amount), now_s)

    def give(self, key: Hashable, now_s: float, amount: float = 1.0) -> None:
        """Give back what was taken for nothing."""
        if key in self._levels:
            self._put(key, self._level(key, now_s) + amount, now_s)

    def _level(self, key: Hashable, now_s: float) -> float:
        level, at_s = self._levels.get(key, (self._burst, now_s))
        return min(self._burst, level + max(0.0, now_s - at_s) * self._per_s)

    def _put(self, key: Hashable, level: float, now_s: float) -> None:
        if level >= self._burst:
            self._levels.pop(key, None)
            return
        self._levels[key] = (level, now_s)
        self._levels.move_to_end(key)
        while len(self._levels) > self._most:
            self._levels.popitem(last=False)
