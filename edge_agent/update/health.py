"""Health check of a new agent version. Pure: link events and the time in, a verdict out.

It is healthy once it has been linked to a gateway, and confirmed by it, for the whole of a window without a break. A
link that breaks begins the window anew. Who has not got there in its time is unhealthy.
"""

from __future__ import annotations

from typing import Literal

__all__ = ["Health", "Verdict"]

Verdict = Literal["waiting", "healthy", "unhealthy"]


class Health:
    """Times are of the monotonic clock, in seconds."""

    def __init__(self, started_s: float, *, window_s: float, within_s: float) -> None:
        self._window_s = window_s
        self._end_s = started_s + max(within_s, window_s)
        self._linked_s: float | None = None
        self._confirmed = False
        self._links = 0

    def linked(self, now_s: float) -> None:
        """There is a link, of all lanes."""
        self._linked_s, self._confirmed = now_s, False
        self._links += 1

    def confirmed(self) -> None:
        """The gateway has said over this link that it has what it needs."""
        self._confirmed = self._linked_s is not None

    def lost(self) -> None:
        """The link ended."""
        self._linked_s, self._confirmed = None, False

    def verdict(self, now_s: float) -> Verdict:
        """How it stands. Ask at least when `wait_s` is over."""
        if self._linked_s is not None and self._confirmed and now_s - self._linked_s >= self._window_s:
            return "healthy"
        return "unhealthy" if now_s >= self._end_s else "waiting"

    def wait_s(self, now_s: float) -> float:
        """Until time alone may change the verdict."""
        ends_s = [self._end_s]
        if self._linked_s is not None and self._confirmed:
            ends_s.append(self._linked_s + self._window_s)
        return max(0.0, min(ends_s) - now_s)

    @property
    def reason(self) -> str:
        """Why it is unhealthy."""
        if not self._links:
            return "it never linked to a gateway"
        if self._linked_s is None or self._links > 1:
            return f"its link did not last for {self._window_s:g} s, {self._links} times"
        return "no gateway confirmed it" if not self._confirmed else "it linked too late"
