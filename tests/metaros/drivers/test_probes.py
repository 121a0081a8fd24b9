"""Buses, autopilots and boards that the system's lists name."""

from __future__ import annotations

from pathlib import Path

import pytest

from metaros.drivers.can import probe as can
from metaros.drivers.mavlink import probe as mavlink
from metaros.drivers.serial import probe as board
from metaros.drivers.serial_sensor import probe as sensor

PORTS = [
    ("/dev/ttyACM0", "Arduino Mega", 0x2341, 0x0042),
    ("/dev/ttyACM1", "CANable", 0x16D0, 0x117E),
    ("/dev/ttyACM2", "CubeOrange", 0x2DAE, 0x1016),
    ("/dev/ttyACM3", "", 0x1209, 0x5740),
    ("/dev/ttyACM4", "STM32 Virtual ComPort", 0x0483, 0x5740),
    ("/dev/ttyACM5", "somebody's thing", 0x1209, 0x0001),
    ("/dev/ttyS0", "", 0, 0),
]


@pytest.fixture(autouse=True)
def ports(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (can, mavlink, board, sensor):
        monkeypatch.setattr(module, "serial_ports", lambda: PORTS)


def test_autopilots() -> None:
    assert [(one.summary, one.parameters["link"], one.certain) for one in mavlink.find()] == [
        ("CubePilot (CubeOrange)", "/dev/ttyACM2", True),
        ("ArduPilot autopilot", "/dev/ttyACM3", True),
        ("could be an autopilot (STM32 Virtual ComPort)", "/dev/ttyACM4", False),
    ]


def test_buses(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, kind, state in (("can0", "280", "up"), ("eth0", "1", "up"), ("vcan1", "280", "unknown")):
        (tmp_path / name).mkdir()
        (tmp_path / name / "type").write_text(f"{kind}\n")
        (tmp_path / name / "operstate").write_text(f"{state}\n")
    (tmp_path / "half").mkdir()
    assert can.interfaces(tmp_path) == [("can0", "up"), ("vcan1", "unknown")]
    assert can.interfaces(tmp_path / "none") == []
    monkeypatch.setattr(can, "interfaces", lambda: [("can0", "up")])
    assert [one.command for one in can.find()] == [
        "metaros driver run can --param channel=can0",
        "metaros driver run can --param interface=slcan --param channel=/dev/ttyACM1",
    ]


def test_boards_and_sensors_are_never_certain() -> None:
    assert [one.command for one in board.find()] == ["metaros driver run serial --param port=/dev/ttyACM0"]
    assert [one.parameters["port"] for one in sensor.find()] == [f"/dev/ttyACM{number}" for number in range(6)]
    assert not any(one.certain for one in (*board.find(), *sensor.find()))
