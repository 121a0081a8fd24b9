"""The newest of each kind, at most so many times a second: a busy bus does not flood who listens. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

__all__ = ["Latest"]


class Latest:
    """`rate_hz` for each key; 0: all. At most `most` keys are kept apart; more are dropped."""

    def __init__(self, rate_hz: float, *, most: int) -> None:
        self._period_s = 1 / rate_hz if rate_hz > 0 else 0.0
        self._most = most
        self._sent_s: dict[Any, float] = {}
        self._waiting: dict[Any, Any] = {}

    def give(self, key: Any, value: Any, now_s: float) -> bool:
        """Whether it goes out now; else it waits, in place of what waited."""
        if not self._period_s:
            return True
        sent_s = self._sent_s.get(key)
        if sent_s is None and len(self._sent_s) >= self._most:
            return False
        if sent_s is None or now_s - sent_s >= self._period_s:
            self._sent_s[key] = now_s
            self._waiting.pop(key, None)
            return True
        self._waiting[key] = value
        return False

    def due(self, now_s: float) -> Iterator[tuple[Any, Any]]:
        """What has waited long enough."""
        waiting: Mapping[Any, Any] = self._waiting
        for key in [key for key in waiting if now_s - self._sent_s[key] >= self._period_s]:
            self._sent_s[key] = now_s
            yield key, self._waiting.pop(key)
