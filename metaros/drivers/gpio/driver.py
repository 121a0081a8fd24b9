"""The driver: reads inputs, sets outputs, and leaves the outputs in their safe state."""

from __future__ import annotations

import contextlib
import math
import warnings
from typing import Any, Final

from metaros.drivers.context import DriverContext
from metaros.drivers.gpio.pins import InputPin, OutputPin, parse_inputs, parse_outputs, refuse_doubles
from metaros.drivers.gpio.states import Debounced, OutputState
from metaros.errors import ConfigError
from metaros.interfaces.std_msgs.msg import Bool
from metaros.wire import qos_command, qos_transient_local

__all__ = ["GpioDevice", "make"]

REPEAT_S: Final = 1.0


def make(context: DriverContext) -> GpioDevice:
    """The pins of the parameters."""
    return GpioDevice(context)


class GpioDevice:
    """Inputs are polled and not waited for: bounces shorter than a period are no events, and no thread is needed."""

    def __init__(self, context: DriverContext) -> None:
        self._context = context
        self._inputs = [_Input(context, pin) for pin in parse_inputs(context["inputs"])]
        self._outputs = [_Output(context, pin) for pin in parse_outputs(context["outputs"])]
        refuse_doubles([each.pin for each in self._inputs], [each.pin for each in self._outputs])
        self._pins: list[_Input | _Output] = [*self._outputs, *self._inputs]
        for each in self._pins:
            each.connect()

    def open(self) -> None:
        """Take the pins; the outputs are safe. ConfigError where this machine has none, or not these."""
        import gpiozero

        try:
            warnings.simplefilter("ignore", gpiozero.GPIOZeroWarning)  # of each way to the pins that this machine lacks
            for each in self._pins:
                each.open()
        except gpiozero.BadPinFactory:
            raise ConfigError(
                "gpio: this machine has no pins that gpiozero can reach; on a Raspberry Pi install lgpio "
                "(pip install lgpio, or apt install python3-lgpio)"
            ) from None
        except (gpiozero.GPIOZeroError, OSError, ValueError) as error:
            raise ConfigError(f"gpio: {error}") from None
        self._context.opened(f"{len(self._inputs)} inputs, {len(self._outputs)} outputs", hardware_id="")

    def run(self) -> None:
        """Look at all pins, `poll_rate` times a second."""
        context = self._context
        period_s = 1 / context["poll_rate"]
        while not context.wait(period_s):
            now_s, debounce_s = context.clock.monotonic_s(), context["debounce"]
            for each in self._inputs:
                each.look(now_s, debounce_s)
            for output in self._outputs:
                output.look(now_s)

    def close(self) -> None:
        """Outputs to their safe state, then all pins are let go."""
        for each in self._pins:
            each.close()


class _Input:
    def __init__(self, context: DriverContext, pin: InputPin) -> None:
        self._context = context
        self.pin = pin
        self._device: Any = None
        self._state = Debounced()
        self._reported_s = -math.inf

    def connect(self) -> None:
        self._publisher = self._context.publisher(Bool, f"gpio/{self.pin.name}", qos_transient_local)

    def open(self) -> None:
        from gpiozero import DigitalInputDevice

        self._state = Debounced()
        floating = self.pin.pull_up is None
        self._device = DigitalInputDevice(
            _pin(self.pin.pin), pull_up=self.pin.pull_up, active_state=True if floating else None
        )

    def look(self, now_s: float, debounce_s: float) -> None:
        seen = bool(self._device.value) != self.pin.inverted
        changed = self._state.look(seen, now_s, debounce_s=debounce_s)
        if changed or now_s - self._reported_s >= REPEAT_S:
            self._reported_s = now_s
            self._publisher.publish(Bool(data=bool(self._state.value)))

    def close(self) -> None:
        device, self._device = self._device, None
        if device is not None:
            device.close()


class _Output:
    def __init__(self, context: DriverContext, pin: OutputPin) -> None:
        self._context = context
        self.pin = pin
        self._device: Any = None
        self._state = OutputState(pin, watchdog_s=context["watchdog"])
        self._reported: bool | None = None
        self._reported_s = -math.inf

    def connect(self) -> None:
        name = f"gpio/{self.pin.name}"
        self._publisher = self._context.publisher(Bool, name, qos_transient_local)
        self._context.subscription(Bool, f"{name}/set", self._on_set, qos_command)

    def open(self) -> None:
        from gpiozero import DigitalOutputDevice

        self._state.rest()
        self._device = DigitalOutputDevice(
            _pin(self.pin.pin), active_high=not self.pin.active_low, initial_value=self.pin.safe
        )

    def look(self, now_s: float) -> None:
        value = self._state.value(now_s)
        if value != self._reported:
            self._device.value = value
        self._report(value, now_s)

    def close(self) -> None:
        device, self._device = self._device, None
        self._state.rest()
        if device is not None:
            with contextlib.suppress(Exception):  # a pin that fails keeps the others from nothing
                device.value = self.pin.safe
            device.close()
            self._report(self.pin.safe, self._context.clock.monotonic_s())
        self._reported, self._reported_s = None, -math.inf

    def _report(self, value: bool, now_s: float) -> None:
        if value != self._reported or now_s - self._reported_s >= REPEAT_S:
            self._reported, self._reported_s = value, now_s
            self._publisher.publish(Bool(data=value), farewell=True)

    def _on_set(self, message: Bool) -> None:
        if self._device is None:
            self._context.count(
                "refused_commands"
            )  # the pins are away: they shall not start by this when they are back
        else:
            self._state.set(message.data, self._context.clock.monotonic_s())


def _pin(text: str) -> int | str:
    """gpiozero takes numbers as the chip's, texts such as BOARD11 as they stand."""
    return int(text) if text.isdecimal() else text
