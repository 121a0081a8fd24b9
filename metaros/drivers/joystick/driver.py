"""The driver: publishes the gamepad's state, and drives where that was asked for."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from metaros.drivers.context import DriverContext, DriverPublisher
from metaros.drivers.joystick.events import EventReader
from metaros.drivers.joystick.input_device import InputDevice
from metaros.drivers.joystick.layout import PadState
from metaros.drivers.joystick.probe import gamepads
from metaros.drivers.joystick.teleop import Teleop
from metaros.errors import UnavailableError
from metaros.interfaces.geometry_msgs.msg import Twist, Vector3
from metaros.interfaces.sensor_msgs.msg import Joy
from metaros.interfaces.std_msgs.msg import Header
from metaros.wire import qos_command

__all__ = ["JoystickDevice", "make"]

SHORTEST_S: Final = 0.01  # gamepads report up to a thousand times a second; more than this is put together


def make(context: DriverContext) -> JoystickDevice:
    """The gamepad of the parameters."""
    return JoystickDevice(context)


class JoystickDevice:
    """Repeats the state at `rate`, so that subscribers know that the gamepad is still connected."""

    def __init__(self, context: DriverContext) -> None:
        self._context = context
        self._device: InputDevice | None = None
        self._joy = context.publisher(Joy, "joy")
        self._commands: DriverPublisher | None = None
        self._teleop = Teleop(
            deadman=context["deadman_button"],
            linear_axis=context["linear_axis"],
            angular_axis=context["angular_axis"],
            max_linear=context["max_linear"],
            max_angular=context["max_angular"],
        )
        if context["teleop"]:
            self._commands = context.publisher(Twist, "cmd_vel", qos_command, reading=False)

    def open(self) -> None:
        """Open the gamepad's file."""
        path = self._context["device"] or next((path for path, _ in gamepads()), "")
        if not path:
            raise UnavailableError("no gamepad is connected")
        self._device = InputDevice(path)
        layout = self._device.layout
        self._context.fact("axes", len(layout.axes))
        self._context.fact("buttons", len(layout.buttons))
        self._context.opened(f"{layout.name} on {path}", hardware_id=layout.name)

    def run(self) -> None:
        """Read and repeat. The state begins with nothing pressed."""
        context, device = self._context, self._device
        assert device is not None
        events, state = EventReader(context.count), PadState(device.layout)
        sent_s, changed = -math.inf, True
        while not context.stopping:
            now_s = context.clock.monotonic_s()
            due_s = sent_s + (SHORTEST_S if changed else 1 / context["rate"])
            if now_s >= due_s:
                self._publish(state)
                sent_s, changed = now_s, False
                continue
            data = device.read(min(due_s - now_s, 0.1))
            for event in events.feed(context.heard(data) if data else data):
                changed = state.take(event) or changed

    def close(self) -> None:
        """Let it go; a base that it drove gets its zero."""
        device, self._device = self._device, None
        self._send(self._teleop.release())
        if device is not None:
            device.close()

    def _publish(self, state: PadState) -> None:
        context = self._context
        axes, buttons = state.axes(context["deadzone"]), state.buttons()
        joy = Joy(header=Header(stamp=context.stamp(), frame_id=context["frame_id"]))
        joy.axes, joy.buttons = np.array(axes, np.float32), np.array(buttons, np.int32)
        self._joy.publish(joy)
        self._send(self._teleop.speeds(axes, buttons))

    def _send(self, speeds: tuple[float, float] | None) -> None:
        if self._commands is not None and speeds is not None:
            linear, angular = speeds
            self._commands.publish(Twist(linear=Vector3(x=linear), angular=Vector3(z=angular)), farewell=True)
