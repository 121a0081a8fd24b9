"""Answers and their deadlines, with a port that a test plays."""

from __future__ import annotations

from typing import Any, cast

import pytest

from metaros.clock import ManualClock
from metaros.drivers.rplidar.conversation import ANSWER_S, Conversation
from metaros.drivers.rplidar.protocol import Info
from metaros.drivers.serial_port import SerialPort
from metaros.drivers.unit import Unit
from metaros.errors import UnavailableError


class Line:
    """A driver and its port: each reading takes so long, and gives the next of these."""

    port = "/dev/ttyUSB0"
    stopping = False

    def __init__(self, *readings: bytes, each_s: float) -> None:
        self.clock = ManualClock()
        self.readings = list(readings)
        self.each_s = each_s
        self.asked = 0

    def write(self, _: bytes) -> None:
        self.asked += 1

    def read(self) -> bytes:
        self.clock.advance(self.each_s)
        return self.readings.pop(0) if self.readings else b""

    def _nothing(self, *_: Any) -> None: ...

    wait = discard = count = _nothing

    def info(self) -> Info:
        return Conversation(cast(Unit, self), cast(SerialPort, self)).info()


ANSWER = Info.DESCRIPTOR.pack() + bytes((0x18, 29, 1, 7)) + bytes(16)


def test_an_answer_that_is_there_after_its_time_is_read() -> None:
    for readings in ([b"", ANSWER], [ANSWER[:7], ANSWER[7:]]):
        line = Line(*readings, each_s=2 * ANSWER_S)
        assert line.info().firmware == (1, 29)
        assert line.asked == 1


def test_one_who_talks_on_but_never_answers_is_asked_three_times() -> None:
    line = Line(*[b"$GPGGA,,,,*66\r\n"] * 1000, each_s=ANSWER_S / 4)
    with pytest.raises(UnavailableError, match="asked 3 times who it is"):
        line.info()
    assert line.asked == 5  # two of them are the stop before it is asked again
