"""A serial port on a pty: read, written, unplugged."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import cast

import pytest

from metaros.clock import ManualClock, system_rng
from metaros.drivers.context import DriverContext
from metaros.drivers.faults import FaultBox
from metaros.drivers.manifest import Manifest
from metaros.drivers.serial_port import SerialPort
from metaros.drivers.status import DriverStatus
from metaros.errors import ConfigError, UnavailableError
from tests.support.devices.pty_device import PtyDevice
from tests.support.waiting import wait_until


class PortContext:
    """As much of a DriverContext as a port asks for."""

    def __init__(self) -> None:
        self.manifest = Manifest(kind="toy", name="Toy", summary="Toys.", quality="bronze")
        self.status = DriverStatus(ManualClock(), stale_after_s=0.0)
        self.faults = FaultBox(system_rng())

    def heard(self, data: bytes) -> bytes:
        """As a DriverContext does."""
        return DriverContext.heard(cast("DriverContext", self), data)


@pytest.fixture
def context() -> DriverContext:
    return cast("DriverContext", PortContext())


@pytest.fixture
def device(tmp_path: Path) -> Iterator[PtyDevice]:
    with PtyDevice(tmp_path) as made:
        yield made


def test_bytes_go_both_ways_and_are_counted(context: DriverContext, device: PtyDevice) -> None:
    port = SerialPort(context, device.path, 115200)
    assert port.read() == b""
    device.write(b"hello")
    got = bytearray()
    wait_until(lambda: bool(got.extend(port.read()) or got == b"hello"))
    assert context.status.counters["bytes_read"] == 5
    port.write(b"there")
    sent = bytearray()
    wait_until(lambda: bool(sent.extend(device.read()) or sent == b"there"))
    port.close()
    port.close()


def test_unplugged_is_said_by_reads_and_writes(context: DriverContext, device: PtyDevice) -> None:
    port = SerialPort(context, device.path, 115200)
    device.unplug()
    with pytest.raises(UnavailableError):
        port.read()
    with pytest.raises(UnavailableError):
        port.write(b"x")
    port.discard()
    port.close()
    with pytest.raises(UnavailableError, match=r"ttyTEST0"):
        SerialPort(context, device.path, 115200)


def test_a_port_in_use_is_not_shared(context: DriverContext, device: PtyDevice) -> None:
    port = SerialPort(context, device.path, 115200)
    with pytest.raises(UnavailableError):
        SerialPort(context, device.path, 115200)
    port.close()
    SerialPort(context, device.path, 115200).close()


def test_what_can_never_be_is_a_configuration_error(context: DriverContext, device: PtyDevice) -> None:
    with pytest.raises(ConfigError, match="port is empty"):
        SerialPort(context, "", 115200)
    with pytest.raises(ConfigError):
        SerialPort(context, device.path, -1)
