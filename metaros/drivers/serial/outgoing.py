"""The send queue to the board: the newest message of each channel, and a few control frames."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from typing import Final

__all__ = ["Outgoing"]

MAX_CONTROL: Final = 64


class Outgoing:
    """Thread-safe. A message that was not sent in time is replaced by the next of its channel, and counted."""

    def __init__(self, count: Callable[[str], object]) -> None:
        self._count = count
        self._condition = threading.Condition()
        self._control: deque[bytes] = deque(maxlen=MAX_CONTROL)
        self._newest: dict[int, bytes] = {}

    def control(self, frame: bytes) -> None:
        """Queue an encoded frame that goes before all data."""
        with self._condition:
            self._control.append(frame)
            self._condition.notify()

    def put(self, channel: int, data: bytes) -> None:
        """Queue a message in place of an older one of its channel."""
        with self._condition:
            if self._newest.pop(channel, None) is not None:
                self._count("skipped_to_board")
            self._newest[channel] = data
            self._condition.notify()

    def take(self, timeout_s: float) -> bytes | tuple[int, bytes] | None:
        """An encoded control frame, else the channel and message that waits longest, else None after `timeout_s`."""
        with self._condition:
            if not self._control and not self._newest:
                self._condition.wait(timeout_s)
            if self._control:
                return self._control.popleft()
            for channel in self._newest:
                return channel, self._newest.pop(channel)
            return None

    def drop(self, channel: int) -> None:
        """Forget what waits for a channel."""
        with self._condition:
            self._newest.pop(channel, None)

    def clear(self) -> None:
        """Forget all."""
        with self._condition:
            self._newest.clear()
            self._control.clear()
