"""The joystick's driver against a pipe that carries the kernel's records."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from random import Random  # noqa: TID251 - seeded

import pytest

import metaros
from metaros.drivers.joystick.layout import STANDARD
from metaros.interfaces.geometry_msgs.msg import Twist
from metaros.interfaces.sensor_msgs.msg import Joy
from tests.support.devices.drivers import RunningDriver, running
from tests.support.devices.gamepad_emulator import TL, GamepadEmulator
from tests.support.waiting import wait_until

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="input events are Linux's")

UP = -32768


@pytest.fixture
def pad(tmp_path: Path) -> Iterator[GamepadEmulator]:
    with GamepadEmulator(tmp_path) as made:
        yield made


def test_axes_and_buttons_are_joy_and_the_state_is_repeated(pad: GamepadEmulator, context: metaros.Context) -> None:
    with running("joystick", {"device": pad.path, "rate": 100.0}, context=context) as driver:
        joys = driver.messages(Joy, "joy")
        pad.plug()
        pad.axis(1, UP)
        pad.axis(0, 16384)
        pad.button(TL, 1)
        wait_until(lambda: joys and joys[-1].buttons[4] == 1)
        seen = len(joys)
        wait_until(lambda: len(joys) > seen + 5)
        joy = joys[-1]
        assert (len(joy.axes), len(joy.buttons)) == (len(STANDARD.axes), len(STANDARD.buttons))
        assert joy.axes[1] == pytest.approx(1.0)
        assert joy.axes[0] == pytest.approx(-(0.5 - 0.1) / 0.9, abs=1e-3)
        assert joy.header.frame_id == "joy"
        assert driver.facts()["axes"] == "8"


def driving(driver: RunningDriver) -> list[Twist]:
    return driver.messages(Twist, "cmd_vel", metaros.qos_command)


def test_it_drives_only_while_the_deadman_button_is_held(pad: GamepadEmulator, context: metaros.Context) -> None:
    params = {"device": pad.path, "teleop": True, "rate": 100.0, "max_linear": 0.4}
    with running("joystick", params, context=context) as driver:
        joys, twists = driver.messages(Joy, "joy"), driving(driver)
        pad.plug()
        pad.axis(1, UP)
        wait_until(lambda: joys and joys[-1].axes[1] == 1.0)
        assert twists == []
        pad.button(TL, 1)
        wait_until(lambda: len(twists) > 5)
        assert twists[-1].linear.x == pytest.approx(0.4)
        pad.button(TL, 0)
        wait_until(lambda: twists[-1].linear.x == 0.0)
        seen, joys_seen = len(twists), len(joys)
        wait_until(lambda: len(joys) > joys_seen + 10)
        assert len(twists) == seen  # one zero, not a stream that would drive against others


def test_unplugged_while_driving_it_sends_zero_and_waits_for_a_new_press(
    pad: GamepadEmulator, context: metaros.Context
) -> None:
    params = {"device": pad.path, "teleop": True, "rate": 100.0}
    with running("joystick", params, context=context) as driver:
        joys, twists = driver.messages(Joy, "joy"), driving(driver)
        pad.plug()
        pad.axis(1, UP)
        pad.button(TL, 1)
        wait_until(lambda: twists and twists[-1].linear.x > 0)
        pad.unplug()
        wait_until(lambda: twists[-1].linear.x == 0.0)
        wait_until(lambda: driver.state() == "waiting")
        seen = len(twists)
        pad.plug()
        joys.clear()
        pad.axis(1, UP)
        pad.button(TL, 2)  # still held: no press
        wait_until(lambda: len(joys) > 10 and joys[-1].axes[1] == 1.0)
        assert len(twists) == seen
        pad.button(TL, 1)
        wait_until(lambda: len(twists) > seen and twists[-1].linear.x > 0)


def test_stopping_the_driver_while_driving_sends_zero(pad: GamepadEmulator, context: metaros.Context) -> None:
    params = {"device": pad.path, "teleop": True}
    with running("joystick", params, context=context) as driver:
        twists = driving(driver)
        pad.plug()
        pad.axis(1, UP)
        pad.button(TL, 1)
        wait_until(lambda: twists and twists[-1].linear.x > 0)
        driver.node.trigger("deactivate")
        wait_until(lambda: twists[-1].linear.x == 0.0)


def test_events_that_the_kernel_dropped_stop_it(pad: GamepadEmulator, context: metaros.Context) -> None:
    params = {"device": pad.path, "teleop": True}
    with running("joystick", params, context=context) as driver:
        twists = driving(driver)
        pad.plug()
        pad.axis(1, UP)
        pad.button(TL, 1)
        wait_until(lambda: twists and twists[-1].linear.x > 0)
        pad.drop()
        wait_until(lambda: twists[-1].linear.x == 0.0)


def test_noise_is_counted_and_moves_nothing(pad: GamepadEmulator, context: metaros.Context) -> None:
    with running("joystick", {"device": pad.path, "teleop": True}, context=context) as driver:
        joys, twists = driver.messages(Joy, "joy"), driving(driver)
        pad.plug()
        pad.write(Random(6).randbytes(50_000) + b"\xff" * 24)
        pad.button(TL + 1, 1)
        wait_until(lambda: joys and joys[-1].buttons[5] == 1)
        wait_until(lambda: int(driver.facts().get("skipped_bytes", 0)) > 35_000)
        wait_until(lambda: driver.state() == "working")
        assert twists == []


def test_a_gamepad_that_is_not_there_is_waited_for(tmp_path: Path, context: metaros.Context) -> None:
    with running("joystick", {"device": str(tmp_path / "none")}, context=context) as driver:
        wait_until(lambda: "No such file" in driver.status().message)
        assert driver.state() == "waiting"
