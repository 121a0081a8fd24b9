"""The GPIO driver on gpiozero's mock pins."""

from __future__ import annotations

import contextlib
import warnings
from collections.abc import Callable, Iterator

import gpiozero
import pytest
from gpiozero.pins.mock import MockFactory

import metaros
from metaros.drivers.gpio.driver import REPEAT_S
from metaros.errors import ConfigError
from metaros.interfaces.std_msgs.msg import Bool
from tests.support.devices.drivers import RunningDriver, running
from tests.support.waiting import wait_until


@pytest.fixture
def pins() -> Iterator[MockFactory]:
    before = gpiozero.Device.pin_factory
    gpiozero.Device.pin_factory = MockFactory()
    try:
        yield gpiozero.Device.pin_factory
    finally:
        gpiozero.Device.pin_factory.reset()
        gpiozero.Device.pin_factory = before


def states(driver: RunningDriver, name: str) -> list[Bool]:
    return driver.messages(Bool, f"gpio/{name}", metaros.qos_transient_local)


def set_until(driver: RunningDriver, name: str, value: bool, condition: Callable[[], object]) -> None:
    publisher = driver.viewer.create_publisher(Bool, f"/r1/gpio/{name}/set", metaros.qos_command)

    def so() -> bool:
        publisher.publish(Bool(data=value))
        return bool(condition())

    wait_until(so, every_s=0.02)
    publisher.close()


def test_inputs_are_reported_at_changes_and_again(pins: MockFactory, context: metaros.Context) -> None:
    with running("gpio", {"inputs": "17:door,27:bumper:pull_up"}, context=context) as driver:
        authenticator, bumper = states(driver, "door"), states(driver, "bumper")
        wait_until(lambda: authenticator and bumper)
        assert (authenticator[-1].data, bumper[-1].data) == (False, False)
        pins.pin(17).drive_high()
        pins.pin(27).drive_low()  # the bumper's switch goes to ground
        wait_until(lambda: authenticator[-1].data and bumper[-1].data)
        seen = len(authenticator)
        driver.leap(REPEAT_S)
        wait_until(lambda: len(authenticator) > seen)
        wait_until(lambda: driver.state() == "working")


def test_inverted_and_floating_inputs(pins: MockFactory, context: metaros.Context) -> None:
    with running("gpio", {"inputs": "17:door:floating:inverted"}, context=context) as driver:
        authenticator = states(driver, "door")
        wait_until(lambda: authenticator and authenticator[-1].data)
        pins.pin(17).drive_high()
        wait_until(lambda: not authenticator[-1].data)


def test_outputs_obey_and_are_safe_at_the_end(pins: MockFactory, context: metaros.Context) -> None:
    params = {"outputs": "22:lamp:off,25:brake:on,26:relay:off:low"}
    with running("gpio", params, context=context) as driver:
        lamp, brake, relay = (states(driver, name) for name in ("lamp", "brake", "relay"))
        wait_until(lambda: lamp and brake and relay)
        assert [pins.pin(number).state for number in (22, 25, 26)] == [0, 1, 1]
        set_until(driver, "lamp", True, lambda: pins.pin(22).state)
        set_until(driver, "brake", False, lambda: not pins.pin(25).state)
        set_until(driver, "relay", True, lambda: not pins.pin(26).state)
        wait_until(lambda: lamp[-1].data and not brake[-1].data and relay[-1].data)
        driver.node.trigger("deactivate")
        wait_until(lambda: not lamp[-1].data and brake[-1].data and not relay[-1].data)
        assert [pins.pin(number).state for number in (22, 25, 26)] == [0, 1, 1]


def test_a_watched_output_falls_back_and_a_pulse_ends(pins: MockFactory, context: metaros.Context) -> None:
    params = {"outputs": "23:pump:off:watchdog,24:horn:pulse=0.05", "watchdog": 0.1}
    with running("gpio", params, context=context) as driver:
        pump, horn = states(driver, "pump"), states(driver, "horn")
        wait_until(lambda: pump and horn)
        for number, name, reported in ((23, "pump", pump), (24, "horn", horn)):
            set_until(driver, name, True, lambda: reported[-1].data)  # noqa: B023
            wait_until(lambda: not reported[-1].data and pins.pin(number).state == 0)  # noqa: B023


def test_unplugged_outputs_are_safe_and_need_a_new_command(pins: MockFactory, context: metaros.Context) -> None:
    params = {"outputs": "22:lamp:off", "allow_faults": True}
    with running("gpio", params, context=context) as driver:
        lamp = states(driver, "lamp")
        set_until(driver, "lamp", True, lambda: lamp and lamp[-1].data)
        driver.node.faults.inject("unplug")
        wait_until(lambda: not lamp[-1].data and driver.state() == "waiting")
        set_until(driver, "lamp", True, lambda: int(driver.facts().get("refused_commands", 0)) > 0)
        lamp.clear()
        driver.node.faults.inject("clear")
        wait_until(lambda: driver.state() == "working" and lamp)
        assert not lamp[-1].data
        assert pins.pin(22).state == 0


def test_a_pin_that_is_taken_says_so(pins: MockFactory, context: metaros.Context) -> None:
    taken = gpiozero.DigitalOutputDevice(22)
    try:
        with running("gpio", {"outputs": "22:lamp:off"}, context=context) as driver:
            wait_until(lambda: driver.state() == "failed")
            assert "already in use" in driver.status().message
    finally:
        taken.close()


def test_a_machine_without_pins_says_what_to_install(context: metaros.Context) -> None:
    with warnings.catch_warnings(), contextlib.suppress(gpiozero.BadPinFactory):
        warnings.simplefilter("ignore")
        gpiozero.Device._default_pin_factory()
        pytest.skip("this machine has pins")
    with running("gpio", {"inputs": "17:door"}, context=context) as driver:
        wait_until(lambda: driver.state() == "failed")
        assert "install lgpio" in driver.status().message


@pytest.mark.parametrize("params", [{}, {"inputs": "17:a,17:b"}, {"outputs": "x"}])
def test_wrong_pins_are_refused_when_it_is_configured(context: metaros.Context, params: dict[str, str]) -> None:
    with running("gpio", params, context=context, start=False) as driver:
        with pytest.raises(ConfigError, match="could not configure: gpio"):
            driver.node.start()
