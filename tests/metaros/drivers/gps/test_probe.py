"""Serial devices that could be ours, by USB ids."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from serial.tools import list_ports

from metaros.drivers.diff_drive import probe as base
from metaros.drivers.gps import probe as gps
from metaros.drivers.imu import probe as imu

PORTS = [
    SimpleNamespace(device="/dev/ttyACM0", description="u-blox 7", vid=0x1546, pid=0x01A7),
    SimpleNamespace(device="/dev/ttyUSB0", description="USB-Serial Controller", vid=0x067B, pid=0x2303),
    SimpleNamespace(device="/dev/ttyUSB1", description="USB Serial", vid=0x1A86, pid=0x7523),
    SimpleNamespace(device="/dev/ttyACM1", description="Arduino Mega", vid=0x2341, pid=0x0042),
    SimpleNamespace(device="/dev/ttyS0", description="n/a", vid=None, pid=None),
]


def test_only_what_its_id_names_is_certain(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(list_ports, "comports", lambda: PORTS)
    found = [*gps.find(), *imu.find(), *base.find()]
    assert [(each.kind, each.parameters["port"], each.certain) for each in found] == [
        ("gps", "/dev/ttyACM0", True),
        ("gps", "/dev/ttyUSB0", False),
        ("imu", "/dev/ttyUSB1", False),
        ("diff_drive", "/dev/ttyACM1", False),
    ]
