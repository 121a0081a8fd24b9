"""How a driver stands, and how diagnostics tell it."""

from __future__ import annotations

from metaros.clock import ManualClock
from metaros.drivers.diagnostics import status_of
from metaros.drivers.status import MAX_COUNTERS, DriverState, DriverStatus
from metaros.interfaces.diagnostic_msgs.msg import DiagnosticStatus


def facts(status: DriverStatus) -> dict[str, str]:
    return {value.key: value.value for value in status_of("/r1/toy", "toy", status).values}


def test_a_device_without_readings_is_stale() -> None:
    clock = ManualClock()
    status = DriverStatus(clock, stale_after_s=2.0)
    status.opened("here", "serial 1")
    clock.advance(1.0)
    status.reading()
    clock.advance(1.9)
    assert status.state is DriverState.WORKING
    clock.advance(0.2)
    assert status.state is DriverState.STALE
    status = status_of("/r1/toy", "toy", status)
    assert (status.level, status.message) == (DiagnosticStatus.STALE, "no reading for 2.1 s")
    assert status.hardware_id == "serial 1"


def test_a_device_that_is_never_stale() -> None:
    clock = ManualClock()
    status = DriverStatus(clock, stale_after_s=0.0)
    status.opened("here", "")
    clock.advance(1e6)
    assert status.state is DriverState.WORKING


def test_the_rate_is_of_the_latest_readings_and_ends_with_them() -> None:
    clock = ManualClock()
    status = DriverStatus(clock, stale_after_s=0.0)
    status.opened("here", "")
    for _ in range(20):
        clock.advance(0.1)
        status.reading()
    assert facts(status)["rate_hz"] == "10"
    clock.advance(5.0)
    assert facts(status)["rate_hz"] == "0"


def test_counters_are_bounded() -> None:
    status = DriverStatus(ManualClock(), stale_after_s=0.0)
    for number in range(1000):
        status.count(f"bad_{number}")
    assert len(status.counters) == MAX_COUNTERS + 1
    assert status.counters["other"] == 1000 - MAX_COUNTERS


def test_levels_and_messages() -> None:
    driver = DriverStatus(ManualClock(), stale_after_s=0.0)
    driver.enter(DriverState.WAITING, "/dev/x: no such file")
    status = status_of("/r1/toy", "toy", driver)
    assert (status.level, status.message, status.name) == (
        DiagnosticStatus.ERROR,
        "/dev/x: no such file",
        "/r1/toy",
    )
    driver.opened("here", "")
    driver.warning = "low battery"
    status = status_of("/r1/toy", "toy", driver)
    assert (status.level, status.message) == (DiagnosticStatus.WARN, "low battery")
    driver.enter(DriverState.RESTING)
    assert status_of("/r1/toy", "toy", driver).level == DiagnosticStatus.OK
