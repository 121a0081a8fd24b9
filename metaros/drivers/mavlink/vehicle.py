"""The one vehicle of a link: which it is, whether it is connected, and its state as `vehicle/state`."""

from __future__ import annotations

import math
from typing import Any, Final

from pymavlink.dialects.v20 import ardupilotmega as dialect

from metaros.drivers.context import DriverContext
from metaros.drivers.mavlink.names import autopilot_name, is_autopilot, mode_name, state_name, type_name
from metaros.interfaces.metaros_msgs.msg import VehicleState
from metaros.wire import qos_transient_local

__all__ = ["LOST_S", "Vehicle"]

LOST_S: Final = 3.0


class Vehicle:
    """The first autopilot that fits the parameters; once found, no other is taken for it."""

    def __init__(self, context: DriverContext) -> None:
        self._context = context
        self._system = context["target_system"]
        self._component = context["target_component"]
        self._states = context.publisher(VehicleState, "vehicle/state", qos_transient_local)
        self._state = VehicleState()
        self.target: tuple[int, int] | None = None
        self.heartbeat_s = -math.inf

    @property
    def connected(self) -> bool:
        """Whether its heartbeat came lately."""
        return self._context.clock.monotonic_s() - self.heartbeat_s <= LOST_S

    @property
    def state(self) -> VehicleState:
        """What its latest heartbeat said."""
        return self._state

    def is_from(self, message: Any) -> bool:
        """Whether a message is of this vehicle; the first heartbeat that fits makes its sender the one."""
        sender = (message.get_srcSystem(), message.get_srcComponent())
        if self.target is None and message.get_type() == "HEARTBEAT" and is_autopilot(message) and self._fits(sender):
            self.target = sender
            self._context.fact("target", f"{sender[0]}.{sender[1]}")
        if self.target is not None and sender == self.target:
            return True
        if self.target is None or sender[0] != self.target[0]:
            self._context.count("other_systems")
        return False

    def on_heartbeat(self, message: Any) -> None:
        """Tell its state: armed, mode and the rest."""
        autopilot, vehicle = autopilot_name(message.autopilot), type_name(message.type)
        self.heartbeat_s = self._context.clock.monotonic_s()
        self._state = VehicleState(
            stamp=self._context.stamp(),
            connected=True,
            armed=bool(message.base_mode & dialect.MAV_MODE_FLAG_SAFETY_ARMED),
            mode=mode_name(autopilot, vehicle, message.custom_mode),
            vehicle=vehicle,
            autopilot=autopilot,
            status=state_name(message.system_status),
        )
        self._states.publish(self._state)

    def lost(self) -> None:
        """Tell that it is heard no longer; what it was then is no knowledge of now."""
        if self._state.connected:
            state = self._state
            self._state = VehicleState(
                stamp=self._context.stamp(), vehicle=state.vehicle, autopilot=state.autopilot, status="lost"
            )
            self._states.publish(self._state, farewell=True)
        self.heartbeat_s = -math.inf

    def _fits(self, sender: tuple[int, int]) -> bool:
        return self._system in (0, sender[0]) and self._component in (0, sender[1])
