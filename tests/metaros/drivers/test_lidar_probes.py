"""What the probes of serial lidars say of ports: that it could be one, by the adapter's id alone."""

from __future__ import annotations

import pytest

from metaros.drivers.ld19 import probe as ld19
from metaros.drivers.rplidar import probe as rplidar

PORTS = [
    ("/dev/ttyACM0", "Arduino", 0x2341, 0x0043),
    ("/dev/ttyS0", "", 0, 0),
    ("/dev/ttyUSB0", "CP2102 USB to UART Bridge Controller", 0x10C4, 0xEA60),
    ("/dev/ttyUSB1", "USB Serial", 0x1A86, 0x7523),
]


def test_adapters_could_have_one(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (ld19, rplidar):
        monkeypatch.setattr(module, "serial_ports", lambda: PORTS)
    assert [found.parameters["port"] for found in ld19.find()] == ["/dev/ttyUSB0", "/dev/ttyUSB1"]
    (found,) = rplidar.find()
    assert found.command == "metaros driver run rplidar --param port=/dev/ttyUSB0"
    assert "could be an RPLIDAR" in found.summary
    assert not any(one.certain for one in (*ld19.find(), *rplidar.find()))
