"""A gamepad's file."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from metaros.drivers.joystick.input_device import InputDevice, read_request
from metaros.drivers.joystick.layout import STANDARD
from metaros.errors import UnavailableError


def test_requests_are_those_of_the_kernels_header() -> None:
    assert read_request(0x06, 256) == 0x81004506  # EVIOCGNAME(256)
    assert read_request(0x20 + 3, 8) == 0x80084523  # EVIOCGBIT(EV_ABS, 8)
    assert read_request(0x40, 24) == 0x80184540  # EVIOCGABS(ABS_X)


def test_a_file_that_is_no_gamepad_has_the_standard_layout_and_ends(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pad")
    device = InputDevice(str(tmp_path / "pad"))
    writer = os.open(tmp_path / "pad", os.O_WRONLY)
    try:
        assert device.layout is STANDARD
        assert device.read(0.0) == b""
        os.write(writer, b"bytes")
        assert device.read(1.0) == b"bytes"
    finally:
        os.close(writer)
    with pytest.raises(UnavailableError, match="it has gone"):
        device.read(1.0)
    device.close()
    device.close()


def test_a_file_that_is_not_there_is_unavailable(tmp_path: Path) -> None:
    with pytest.raises(UnavailableError, match="No such file"):
        InputDevice(str(tmp_path / "none"))
