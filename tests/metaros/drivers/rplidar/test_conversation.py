"""The words with an RPLIDAR on a port that answers at once."""

from __future__ import annotations

from collections import Counter
from typing import Any

import pytest

from metaros.clock import ManualClock
from metaros.drivers.rplidar.conversation import Conversation
from metaros.errors import UnavailableError
from tests.support.rplidar_emulator import RplidarEmulator


class FakeUnit:
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
    """A port with an emulated device behind it."""

    port = "/dev/fake"

    def __init__(self) -> None:
        self._came = bytearray()
        self.lidar = RplidarEmulator(self._came.extend)

    def write(self, data: bytes) -> None:
        self.lidar.heard(data)

    def read(self) -> bytes:
        data = bytes(self._came)
        self._came.clear()
        return data

    def discard(self) -> None:
        self._came.clear()


@pytest.mark.parametrize("heals", [True, False])
def test_one_in_error_is_reset_once_and_no_more(heals: bool) -> None:
    unit: Any = FakeUnit()
    port: Any = FakePort()
    port.lidar.status, port.lidar.heals = 2, heals
    talk = Conversation(unit, port)
    if heals:
        assert talk.check_health().word == "good"
    else:
        with pytest.raises(UnavailableError, match=r"/dev/fake: its health is bad \(code 32769\), also after a reset"):
            talk.check_health()
    assert unit.counts == {"resets": 1}
    assert port.lidar.commands.count(0x40) == 1
    assert unit.warnings == ["its health is bad (code 32769): reset"]
