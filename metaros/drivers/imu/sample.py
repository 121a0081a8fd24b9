"""One sample of an IMU, whatever protocol it came by. Pure."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final, TypeAlias

__all__ = ["GRAVITY_M_S2", "Quaternion", "Sample", "Vector", "plausible"]

Vector: TypeAlias = tuple[float, float, float]
Quaternion: TypeAlias = tuple[float, float, float, float]  # w, x, y, z

GRAVITY_M_S2: Final = 9.80665
_MAX_ACCELERATION_M_S2: Final = 50 * GRAVITY_M_S2
_MAX_RATE_RAD_S: Final = 100.0  # gyroscopes of this kind end at 4000 degrees a second
_MAX_FIELD_T: Final = 0.05  # the earth has 65 microtesla, a magnet nearby some millitesla


@dataclass(frozen=True, slots=True, kw_only=True)
class Sample:
    """SI units, in the device's own frame: x forward, y left, z up where it is mounted so."""

    acceleration_m_s2: Vector
    rate_rad_s: Vector
    magnetic_t: Vector | None = None
    orientation: Quaternion | None = None
    temperature_c: float | None = None


def plausible(sample: Sample) -> bool:
    """Whether all numbers are finite and what such a device can measure: lines of text have no checksum."""
    return (
        _within(sample.acceleration_m_s2, _MAX_ACCELERATION_M_S2)
        and _within(sample.rate_rad_s, _MAX_RATE_RAD_S)
        and _within(sample.magnetic_t or (), _MAX_FIELD_T)
        and _within(sample.orientation or (), 1.01)
    )


def _within(values: Iterable[float], most: float) -> bool:
    return all(math.isfinite(value) and abs(value) <= most for value in values)
