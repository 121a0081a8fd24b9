"""Requests to the motor board: speeds out, encoder counts back, never waiting long."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from metaros.drivers.context import DriverContext
from metaros.drivers.diff_drive.protocol import READ_ENCODERS, STOP, is_ok, parse_encoders, speeds
from metaros.drivers.lines import LineSplitter
from metaros.drivers.serial_port import SerialPort

__all__ = ["MotorBoard"]

ANSWER_S: Final = 0.2
MAX_LINE: Final = 64


class MotorBoard:
    """Counts `no_answer` and `bad_answers`."""

    def __init__(self, context: DriverContext, port: SerialPort) -> None:
        self._context = context
        self._port = port
        self._lines = LineSplitter(max_bytes=MAX_LINE, count=context.count)

    def exchange(self, left_ticks: int, right_ticks: int) -> tuple[int, int] | None:
        """Turn the wheels (ticks in one period of the board's controller) and read the encoders, left and right; None
        where no such answer came. Both go out together, so that a stop never waits for an answer.
        """
        for line in self._ask(speeds(left_ticks, right_ticks) + READ_ENCODERS):
            if (counts := parse_encoders(line)) is not None:
                return counts
            if not is_ok(line):
                self._context.count("bad_answers")
        return None

    def stop(self) -> None:
        """Say so, and do not wait for the answer."""
        self._port.write(STOP)

    def _ask(self, command: bytes) -> Iterator[str]:
        self._port.discard()  # an answer that came too late belongs to nothing any more
        self._lines.clear()
        self._port.write(command)
        until_s, over = self._context.clock.monotonic_s() + ANSWER_S, False
        while not over and not self._context.stopping:
            # One more reading after the deadline: where it was this process that slept, the answer is there.
            over = self._context.clock.monotonic_s() >= until_s
            yield from self._lines.feed(self._port.read())
        self._context.count("no_answer")
