"""Gamepads in the kernel's list."""

from __future__ import annotations

from pathlib import Path

from metaros.drivers.joystick.probe import gamepads

LIST = """I: Bus=0003 Vendor=045e Product=028e Version=0114
N: Name="Microsoft X-Box 360 pad"
P: Phys=usb-0000:00:14.0-2/input0
H: Handlers=event17 js0
B: EV=20000b

I: Bus=0011 Vendor=0001 Product=0001 Version=ab41
N: Name="AT Translated Set 2 keyboard"
H: Handlers=sysrq kbd event3 leds

I: Bus=0003
H: Handlers=js1 event18
"""


def test_what_the_joystick_handler_took_is_a_gamepad(tmp_path: Path) -> None:
    devices = tmp_path / "devices"
    devices.write_text(LIST, encoding="utf-8")
    assert gamepads(devices) == [("/dev/input/event17", "Microsoft X-Box 360 pad"), ("/dev/input/event18", "event18")]


def test_a_machine_without_the_list_has_none(tmp_path: Path) -> None:
    assert gamepads(tmp_path / "none") == []
