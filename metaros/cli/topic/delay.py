"""How old messages are when they arrive: the stamp in their header against this machine's calendar."""

from __future__ import annotations

import math
from collections import deque
from typing import TYPE_CHECKING, Any

from metaros.clock import Clock
from metaros.errors import UsageError

if TYPE_CHECKING:
    from metaros.idl import Catalogue

__all__ = ["Delay"]

_SILENT_S = 2.0


class Delay:
    """Delays of the last `window` messages of one type; UsageError where the type has no header."""

    def __init__(self, window: int, type_name: str, *, clock: Clock, catalogue: Catalogue | None = None) -> None:
        from metaros.cdr import codec
        from metaros.idl import message_class

        fields = {field.name: field.type.base for field in message_class(type_name, catalogue).__metaros_fields__}
        if fields.get("header") != "std_msgs/msg/Header":
            raise UsageError(f"{type_name} has no header, so its messages do not say when they were made")
        self._decode = codec(type_name, catalogue).decode
        self._clock = clock
        self._delays: deque[float] = deque(maxlen=window)
        self._last = 0.0

    def add(self, now: float, payload: bytes) -> None:
        """A message arrived at `now`; it may have waited since."""
        stamp = self._decode(payload).header.stamp
        waited = self._clock.monotonic_s() - now
        made_ns = stamp.sec * 10**9 + stamp.nanosec
        self._delays.append((self._clock.wall_ns() - made_ns) / 1e9 - waited)
        self._last = now

    def report(self, now: float) -> dict[str, Any]:
        """The figures over the window; silence empties it."""
        if not self._delays or now - self._last > _SILENT_S:
            self._delays.clear()
            return {"window": 0}
        mean = sum(self._delays) / len(self._delays)
        return {
            "delay_s": mean,
            "min_s": min(self._delays),
            "max_s": max(self._delays),
            "std_s": math.sqrt(sum((item - mean) ** 2 for item in self._delays) / len(self._delays)),
            "window": len(self._delays),
        }
