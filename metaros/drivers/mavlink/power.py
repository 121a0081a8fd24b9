"""The vehicle's battery: BATTERY_STATUS where it sends one, else what SYS_STATUS says."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from metaros.drivers.context import DriverContext
from metaros.interfaces.sensor_msgs.msg import BatteryState
from metaros.interfaces.std_msgs.msg import Header

__all__ = ["Power"]

_FRESH_S: Final = 15.0
_NONE: Final = 0xFFFF


class Power:
    """Publishes `vehicle/battery`, of the battery with id 0. As in ROS, a current that drains it is negative."""

    def __init__(self, context: DriverContext) -> None:
        self._context = context
        self._states = context.publisher(BatteryState, "vehicle/battery", reading=False)
        self._status_s = -math.inf

    def on_battery(self, message: Any) -> None:
        """BATTERY_STATUS."""
        if message.id != 0:
            return
        self._status_s = self._context.clock.monotonic_s()
        cells = [volts / 1000 for volts in message.voltages if volts != _NONE]
        state = self._state(sum(cells) if cells else math.nan, message.current_battery, message.battery_remaining)
        if len(cells) > 1:  # one alone is the whole battery
            state.cell_voltage = np.array(cells, np.float32)
        if message.temperature != 0x7FFF:
            state.temperature = message.temperature / 100
        self._states.publish(state)

    def on_system(self, message: Any) -> None:
        """SYS_STATUS."""
        if self._context.clock.monotonic_s() - self._status_s > _FRESH_S:
            volts = math.nan if message.voltage_battery in (0, _NONE) else message.voltage_battery / 1000
            self._states.publish(self._state(volts, message.current_battery, message.battery_remaining))

    def _state(self, volts: float, centi_amperes: int, percent: int) -> BatteryState:
        state = BatteryState(header=Header(stamp=self._context.stamp(), frame_id=self._context["frame_id"]))
        state.voltage = volts
        state.current = math.nan if centi_amperes == -1 else -centi_amperes / 100
        state.percentage = percent / 100 if 0 <= percent <= 100 else math.nan
        state.temperature = state.charge = state.capacity = state.design_capacity = math.nan
        state.present = math.isfinite(volts)
        if centi_amperes > 0:
            state.power_supply_status = BatteryState.POWER_SUPPLY_STATUS_DISCHARGING
        return state
