"""The words with an RPLIDAR on a port that answers at once, or as late as a test says."""

from __future__ import annotations

from collections import Counter
from typing import Any

import pytest

from metaros.clock import ManualClock
from metaros.drivers.rplidar.connection import ANSWER_S, RplidarConnection
from metaros.errors import UnavailableError
from tests.support.devices.rplidar_emulator import RplidarEmulator


class FakeContext:
    """Counts, and lets time pass that it is asked to wait for."""

    def __init__(self) -> None:
        self.clock = ManualClock()
        self.stopping = False
        self.counts: Counter[str] = Counter()
        self.warnings: list[str] = []
        self.count = lambda name: self.counts.update([name])
        self.warn = self.warnings.append
        self.wait = self.clock.advance


class FakePort:
    """A port with an emulated device behind it, whose readings take so long."""

    port = "/dev/fake"

    def __init__(self, clock: ManualClock, *, reading_s: float = 0.0) -> None:
        self._clock = clock
        self._reading_s = reading_s
        self._came = bytearray()
        self.lidar = RplidarEmulator(self._came.extend)
        self.sizes: list[int] = []  # of the next readings; then all that is there
        self.chatter = b""  # instead of what the device sends

    def write(self, data: bytes) -> None:
        self.lidar.heard(data)

    def read(self) -> bytes:
        self._clock.advance(self._reading_s)
        size = self.sizes.pop(0) if self.sizes else len(self._came)
        data = bytes(self._came[:size])
        del self._came[:size]
        return self.chatter or data

    def discard(self) -> None:
        self._came.clear()


@pytest.mark.parametrize("heals", [True, False])
def test_one_in_error_is_reset_once_and_no_more(heals: bool) -> None:
    context: Any = FakeContext()
    port: Any = FakePort(context.clock)
    port.lidar.status, port.lidar.heals = 2, heals
    connection = RplidarConnection(context, port)
    if heals:
        assert connection.check_health().word == "good"
    else:
        with pytest.raises(UnavailableError, match=r"/dev/fake: its health is bad \(code 32769\), also after a reset"):
            connection.check_health()
    assert context.counts == {"resets": 1}
    assert port.lidar.commands.count(0x40) == 1
    assert context.warnings == ["its health is bad (code 32769): reset"]


@pytest.mark.parametrize("sizes", [[0], [7, 10]], ids=["all of it", "its end"])
def test_an_answer_that_is_there_after_its_time_is_read(sizes: list[int]) -> None:
    context: Any = FakeContext()
    port: Any = FakePort(context.clock, reading_s=2 * ANSWER_S)
    port.sizes = sizes
    assert RplidarConnection(context, port).info().firmware == (1, 29)
    assert port.lidar.commands == [0x50]


def test_who_does_not_answer_is_asked_again() -> None:
    context: Any = FakeContext()
    port: Any = FakePort(context.clock, reading_s=ANSWER_S / 4)
    port.lidar.mute, port.lidar.wrong_answers = 2, True
    assert RplidarConnection(context, port).info().firmware == (1, 29)
    assert port.lidar.commands.count(0x50) == 3
    assert context.counts == {"asked_again": 2, "wrong_answers": 1}


def test_one_who_talks_on_but_never_answers_is_asked_three_times() -> None:
    context: Any = FakeContext()
    port: Any = FakePort(context.clock, reading_s=ANSWER_S / 4)
    port.chatter = b"$GPGGA,,,,*66\r\n"
    with pytest.raises(UnavailableError, match=r"no RPLIDAR answers here \(asked 3 times who it is\)"):
        RplidarConnection(context, port).info()
    assert port.lidar.commands.count(0x50) == 3
