"""A sensor that writes lines on a pty: its values, through garbage, unplugging and replugging."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

import metaros
from metaros.clock import system_rng
from metaros.interfaces.std_msgs.msg import Float64
from tests.support.devices.drivers import RunningDriver, running
from tests.support.devices.pty_device import PtyDevice
from tests.support.waiting import wait_until


@pytest.fixture
def device(tmp_path: Path) -> Iterator[PtyDevice]:
    with PtyDevice(tmp_path) as made:
        yield made


def received(driver: RunningDriver, device: PtyDevice, values: list[Float64], line: bytes) -> Float64:
    """The value that the line brings, sent until one comes: what is sent before the port is open is lost."""
    before = len(values)

    def sent() -> bool:
        device.write(line)
        return len(values) > before

    wait_until(sent)
    return values[-1]


def test_values_come_again_after_garbage_and_unplugging(device: PtyDevice, context: metaros.Context) -> None:
    parameters = {"port": device.path, "format": "json", "fields": "t,air.h", "topic": "weather"}
    with running("serial_sensor", parameters, context=context) as driver:
        warm, humid = driver.messages(Float64, "weather/t"), driver.messages(Float64, "weather/air/h")
        line = b'{"t": 21.5, "air": {"h": 40}}\r\n'
        assert received(driver, device, warm, line).data == 21.5
        wait_until(lambda: bool(humid) and humid[-1].data == 40.0)

        device.write(system_rng().randbytes(50_000) + b"\n[]\n")
        assert received(driver, device, warm, b'\n{"t": -1}\n').data in (21.5, -1.0)
        wait_until(lambda: int(driver.facts().get("bad_lines", 0)) > 0 and "missing_fields" in driver.facts())

        device.unplug()
        wait_until(lambda: driver.state() in ("waiting", "opening"))
        device.replug()
        # Values of before may still be on their way.
        wait_until(lambda: received(driver, device, warm, b'{"t": 3}\n').data == 3.0)
        wait_until(lambda: driver.state() == "working")
