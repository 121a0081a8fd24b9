"""The conversation with a motor board, without a port."""

from __future__ import annotations

from collections import Counter
from typing import Any

from metaros.clock import ManualClock
from metaros.drivers.diff_drive.motor_board import ANSWER_S, MotorBoard


class FakePort:
    """Answers come `late_s` after the question, and are there when this process is awake again."""

    def __init__(self, clock: ManualClock, *, late_s: float) -> None:
        self._clock, self._late_s = clock, late_s
        self._answers = b""

    def discard(self) -> None:
        self._answers = b""

    def write(self, data: bytes) -> None:
        self._answers = b"OK\r\n12 34\r\n"

    def read(self) -> bytes:
        self._clock.advance(self._late_s)
        late_s, self._late_s = self._late_s, 0.0
        if late_s:
            return b""
        answers, self._answers = self._answers, b""
        return answers


class FakeContext:
    def __init__(self) -> None:
        self.clock = ManualClock()
        self.stopping = False
        self.counted: Counter[str] = Counter()

    def count(self, name: str) -> None:
        self.counted[name] += 1


def test_a_process_that_slept_finds_its_answer() -> None:
    context: Any = FakeContext()
    port: Any = FakePort(context.clock, late_s=10 * ANSWER_S)
    assert MotorBoard(context, port).exchange(0, 0) == (12, 34)
    assert not context.counted
