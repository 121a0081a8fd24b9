"""The pace of devices that have none, and a device that is pulled out, or hangs, while it is open."""

from __future__ import annotations

from typing import Any

import pytest

import metaros
from metaros.clock import ManualClock
from metaros.drivers import sound
from metaros.drivers.sound import PACKET_S, Pacer
from metaros.interfaces.foxglove_msgs.msg import RawAudio
from tests.support.devices.drivers import running
from tests.support.waiting import wait_until


def test_a_device_that_never_blocks_is_kept_at_its_rate() -> None:
    clock = ManualClock()
    pacer = Pacer(clock)
    began_s = clock.monotonic_s()
    for _ in range(500):
        clock.advance(pacer.ahead_s(blocked=False))
    assert clock.monotonic_s() - began_s == pytest.approx(500 * PACKET_S, abs=0.1)
    clock.advance(60.0)  # the machine slept: nothing is made up for
    assert sum(pacer.ahead_s(blocked=False) == 0 for _ in range(100)) <= 4


def test_a_device_that_blocks_is_never_waited_for() -> None:
    clock = ManualClock()
    pacer = Pacer(clock)
    for _ in range(10_000):  # its clock is faster than ours, by a thousandth
        clock.advance(PACKET_S * 0.999)
        assert pacer.ahead_s(blocked=True) == 0


class FakePortAudio:
    """The part of the module sounddevice that is used, with one input that can be broken."""

    class PortAudioError(Exception):
        """As sounddevice has it."""

    def __init__(self) -> None:
        self.broken = ""
        self.initialised = self.opened = self.closed = 0

    def _terminate(self) -> None:
        self.initialised -= 1

    def _initialize(self) -> None:
        self.initialised += 1
        assert self.opened == self.closed, "the list of devices is made anew only while none is open"

    def query_devices(self, device: str | int | None, kind: str) -> dict[str, str]:
        if self.broken == "gone":
            raise ValueError(f"no {kind} device matching {device!r}")
        return {"name": "fake"}

    def RawInputStream(self, **_options: Any) -> FakePortAudio:
        self.opened += 1
        return self

    def start(self) -> None:
        """It is always ready."""

    @property
    def read_available(self) -> int:
        return 0 if self.broken == "hangs" else 4000

    def read(self, frames: int) -> tuple[bytes, bool]:
        if self.broken == "gone":
            raise self.PortAudioError("Device unavailable [PaErrorCode -9985]")
        return bytes(2 * frames), self.broken == "overflows"

    def close(self, *, ignore_errors: bool) -> None:
        self.closed += 1


@pytest.mark.parametrize(("how", "said"), [("gone", "Device unavailable"), ("hangs", "no sound moved")])
def test_a_device_that_breaks_while_it_is_open(
    how: str, said: str, monkeypatch: pytest.MonkeyPatch, context: metaros.Context
) -> None:
    fake = FakePortAudio()
    monkeypatch.setattr(sound, "_portaudio", lambda: fake)
    monkeypatch.setattr(sound, "STUCK_S", 0.2)
    with running("microphone", {"device": "fake"}, context=context) as driver:
        received, reported = driver.messages(RawAudio, "audio"), set[str]()
        wait_until(lambda: len(received) > 3)
        fake.broken = how
        wait_until(lambda: reported.add(driver.status().message) or any(said in text for text in reported))
        wait_until(lambda: driver.state() == "waiting")
        fake.broken = ""
        count = len(received)
        wait_until(lambda: len(received) > count + 3 and driver.state() == "working")
        fake.broken = "overflows"
        wait_until(lambda: int(driver.facts().get("overflows", 0)) > 3)
    assert fake.opened == fake.closed > 1
