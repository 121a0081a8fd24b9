"""Commands to the vehicle, where this robot's own settings allow them: arm, change mode, move."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from pymavlink.dialects.v20 import ardupilotmega as dialect

from metaros.drivers.context import DriverContext
from metaros.drivers.mavlink.command_sender import CommandSender
from metaros.drivers.mavlink.names import mode_numbers, mode_numbers_of
from metaros.drivers.mavlink.vehicle import Vehicle
from metaros.drivers.mavlink.velocity import VelocityGate
from metaros.errors import UnavailableError
from metaros.interfaces.geometry_msgs.msg import Twist
from metaros.interfaces.metaros_msgs.srv import SetMode
from metaros.interfaces.std_srvs.srv import SetBool
from metaros.wire import qos_command

__all__ = ["VELOCITY_PERIOD_S", "VehicleControl"]

VELOCITY_PERIOD_S: Final = 0.05
# Ignore position, acceleration and yaw: what is left is velocity and the rate of yaw.
_VELOCITY_ONLY: Final = 0b0000_0101_1100_0111


class VehicleControl:
    """`send(message)` may raise UnavailableError."""

    def __init__(self, context: DriverContext, vehicle: Vehicle, send: Callable[[Any], None]) -> None:
        self._context = context
        self._vehicle = vehicle
        self._send = send
        self.commands = CommandSender(send, monotonic_s=context.clock.monotonic_s)
        limits = (context["max_horizontal"], context["max_vertical"], context["max_turn"])
        self._gate = VelocityGate(limits, watchdog_s=context["watchdog"])
        self._next_s = 0.0
        if context["allow_arm"]:
            context.service(SetBool, "vehicle/arm", self._on_arm)
        if context["allow_mode"]:
            context.service(SetMode, "vehicle/set_mode", self._on_mode)
        if context["allow_velocity"]:
            context.subscription(Twist, "vehicle/cmd_vel", self._on_velocity, qos_command, dedicated=True)

    def work(self) -> None:
        """Say the velocity of now, if there is one; on the driver's thread."""
        now_s = self._context.clock.monotonic_s()
        if now_s >= self._next_s:
            self._next_s = now_s + VELOCITY_PERIOD_S
            if (velocity := self._gate.velocity(now_s)) is not None:
                self._say(velocity)

    def forget(self) -> None:
        """The link is lost, or was: nothing of before is done any more."""
        self._gate.forget()
        self.commands.give_up()

    def rest(self) -> None:
        """The driver ends while the vehicle is there: it is told to stand still, if it was told to move."""
        if self._gate.forget() and self._vehicle.connected:
            self._say((0.0, 0.0, 0.0, 0.0))
        self.commands.give_up()

    # -- from others -----------------------------------------------------------------------------------------------

    def _on_velocity(self, message: Twist) -> None:
        linear, angular = message.linear, message.angular
        wanted = (linear.x, linear.y, linear.z, angular.z)
        if not self._vehicle.connected or not self._gate.command(wanted, self._context.clock.monotonic_s()):
            self._context.count("refused_commands")

    def _on_arm(self, request: Any, response: Any) -> Any:
        # Never with the parameter that forces it: the autopilot's own checks decide, also against disarming in flight.
        why_not = self._ask(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1.0 if request.data else 0.0)
        response.success = not why_not
        response.message = why_not or ("armed" if request.data else "disarmed")
        return response

    def _on_mode(self, request: Any, response: Any) -> Any:
        state = self._vehicle.state
        numbers = mode_numbers_of(state.autopilot, state.vehicle, request.mode)
        if not self._vehicle.connected:
            why_not = "the vehicle is not connected"
        elif numbers is None:
            known = ", ".join(sorted(mode_numbers(state.autopilot, state.vehicle)))
            why_not = f"no mode {request.mode[:40]!r}; there are {known or 'none that we know'}"
        else:
            custom = float(dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED)
            why_not = self._ask(dialect.MAV_CMD_DO_SET_MODE, custom, float(numbers[0]), float(numbers[1]))
        response.success, response.message = not why_not, why_not or request.mode.strip().upper()
        return response

    def _ask(self, command: int, *parameters: float) -> str:
        target = self._vehicle.target
        if not self._context.active or target is None or not self._vehicle.connected:
            why_not = "the vehicle is not connected"
        else:
            try:
                why_not = self.commands.ask(target, command, *parameters)
            except UnavailableError as error:
                why_not = str(error)
        if why_not:
            self._context.count("refused_commands")
        return why_not

    def _say(self, velocity: tuple[float, float, float, float]) -> None:
        target = self._vehicle.target
        if target is None:
            return
        x, y, z, turn = velocity
        boot_ms = int(self._context.clock.monotonic_s() * 1000) & 0xFFFFFFFF
        nothing = (0.0, 0.0, 0.0)
        self._send(
            dialect.MAVLink_set_position_target_local_ned_message(
                boot_ms,
                *target,
                dialect.MAV_FRAME_BODY_NED,
                _VELOCITY_ONLY,
                *nothing,
                *(x, -y, -z),  # forward, right, down
                *nothing,
                0.0,
                -turn,
            )
        )
