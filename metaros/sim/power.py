"""A battery and its voltage curve, and the heat of a motor. Pure models with physical units."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass

__all__ = ["AMBIENT_C", "Battery", "Motor"]

AMBIENT_C = 24.0
_CHARGE = (0.0, 0.05, 0.1, 0.2, 0.5, 0.8, 0.95, 1.0)
_OPEN_V = (20.0, 22.6, 23.6, 24.6, 25.6, 26.6, 27.4, 28.4)  # a seven-cell lithium-ion pack at rest


@dataclass(slots=True)
class Battery:
    """A 25 V pack; `charge` is the part left, 0..1."""

    charge: float
    capacity_ah: float = 12.0
    resistance_ohm: float = 0.06
    current_a: float = 0.0
    temperature_c: float = AMBIENT_C + 2.0
    discharged_wh: float = 0.0

    @property
    def voltage_v(self) -> float:
        """Terminal voltage under the present load."""
        upper = min(bisect_right(_CHARGE, self.charge), len(_CHARGE) - 1)  # np.interp, for a tenth of its time
        charge, rest_v = _CHARGE[upper - 1], _OPEN_V[upper - 1]
        slope = (_OPEN_V[upper] - rest_v) / (_CHARGE[upper] - charge)
        return slope * (self.charge - charge) + rest_v - self.current_a * self.resistance_ohm

    def draw(self, power_w: float, *, dt_s: float) -> None:
        """Take power out for `dt_s`; an empty pack gives none."""
        if self.charge <= 0.0:
            self.current_a = 0.0
            return
        self.current_a = power_w / self.voltage_v
        self.charge = max(0.0, self.charge - self.current_a * dt_s / 3600.0 / self.capacity_ah)
        self.discharged_wh += power_w * dt_s / 3600.0
        heat_c = self.current_a**2 * self.resistance_ohm * 3.0
        self.temperature_c += (AMBIENT_C + 2.0 + heat_c - self.temperature_c) * dt_s / 240.0

    def feed(self, part_per_s: float, *, dt_s: float) -> None:
        """Take in that part of its charge a second, beside what the robot draws."""
        self.current_a -= part_per_s * self.capacity_ah * 3600.0
        self.charge = min(1.0, self.charge + part_per_s * dt_s)

    def drain(self, part: float) -> None:
        """Lose a part of the charge at once, as a failing cell does."""
        self.charge = max(0.0, self.charge - part)


@dataclass(slots=True)
class Motor:
    """A wheel's motor: its current follows effort, its heat follows current squared."""

    temperature_c: float = AMBIENT_C + 8.0
    current_a: float = 0.0

    def run(self, *, speed_m_s: float, accel_m_s2: float, stalled: bool, extra_c: float, dt_s: float) -> None:
        """Advance by `dt_s` at a wheel speed and acceleration; `extra_c` is heat from elsewhere."""
        effort_a = 0.35 + 1.1 * abs(speed_m_s) + 0.9 * abs(accel_m_s2)
        self.current_a = 9.0 if stalled else min(effort_a, 6.0) if speed_m_s or accel_m_s2 else 0.15
        goal_c = AMBIENT_C + extra_c + 8.0 * self.current_a**2 / (1.0 + 0.05 * self.current_a**2)
        self.temperature_c += (goal_c - self.temperature_c) * dt_s / 45.0

    @property
    def power_w(self) -> float:
        """Electrical power taken from a 25 V bus."""
        return self.current_a * 25.0
