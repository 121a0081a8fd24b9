"""What is sent on a lane and not acknowledged: bounded in bytes and batches. Pure."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

__all__ = ["Window"]


@dataclass(slots=True)
class Window:
    """Opens and closes as frames go out and acknowledgements come; both limits are the gateway's."""

    max_bytes: int = 0
    max_batches: int = 0
    size_bytes: int = 0
    batches: int = 0
    waiting_since_s: float = 0.0  # when the gateway last acknowledged something, while something is out
    delay_s: float = 0.0  # what the frame that was acknowledged last took, from being sent
    _flights: dict[tuple[int, int], deque[tuple[int, int, float]]] = field(default_factory=dict)  # seq, bytes, time

    def open(self) -> bool:
        """Whether more may be sent."""
        return self.batches < self.max_batches and self.size_bytes < self.max_bytes

    def sent(self, epoch: int, stream_id: int, last_seq: int, size_bytes: int, now_s: float) -> None:
        """A frame went out."""
        if self.batches == 0:
            self.waiting_since_s = now_s
        self._flights.setdefault((epoch, stream_id), deque()).append((last_seq, size_bytes, now_s))
        self.batches += 1
        self.size_bytes += size_bytes

    def acknowledged(self, epoch: int, stream_id: int, seq: int, now_s: float) -> int:
        """A stream is stored up to `seq`; how many bytes that frees."""
        flight, freed = self._flights.get((epoch, stream_id), ()), 0
        while flight and flight[0][0] <= seq:
            _, size_bytes, sent_s = flight.popleft()
            freed += size_bytes
            self.delay_s = now_s - sent_s
            self.batches -= 1
            self.waiting_since_s = now_s
        self.size_bytes -= freed
        return freed

    def clear(self) -> None:
        """Nothing is out any more: it will be sent again."""
        self._flights.clear()
        self.size_bytes = self.batches = 0
