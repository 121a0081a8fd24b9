"""From the rays of a spinning lidar to `sensor_msgs/LaserScan`: revolutions are split behind the device and binned.

Lidars count their angle clockwise from ahead, in degrees; ROS counts counter-clockwise from ahead, in radians. A turn
is cut where the ray points backwards, so that the bins, from -π to just below π, are in one run of time: bin 0 was
measured last. Therefore a scan's stamp is that of bin 0, and `time_increment` is negative: `stamp + i * time_increment`
is when ray i was measured. Each bin has the nearest return in it; +inf where rays came back with nothing, NaN where
there was no ray at all (REP 117).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from metaros.convert.stamps import header
from metaros.interfaces.sensor_msgs.msg import LaserScan

__all__ = ["MAX_RAYS", "Rays", "Revolution", "ScanAssembler", "laser_scan"]

MAX_RAYS: Final = 32_768  # of one turn; more than any lidar of ours has
MIN_RAYS: Final = 16  # fewer are a stumble of the angle, not a turn
_SECOND_NS: Final = 1_000_000_000

Floats = npt.NDArray[np.float32]


@dataclass(frozen=True, slots=True, kw_only=True)
class Rays:
    """Some rays in the order of measuring. `ranges_m` 0: nothing came back. `stamp_ns`: of the last one."""

    angles_deg: Sequence[float]
    ranges_m: Sequence[float]
    intensities: Sequence[float]
    stamp_ns: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Revolution:
    """One whole revolution as measured: clockwise angles from ahead, and when its first and last ray were measured."""

    angles_deg: npt.NDArray[np.float64]
    ranges_m: Floats
    intensities: Floats
    began_ns: int
    ended_ns: int


class ScanAssembler:
    """Rays in, whole revolutions out. The first, whose beginning is unknown, and angle glitches are left out."""

    def __init__(self) -> None:
        self.short_turns = 0
        self.overlong_turns = 0
        self._whole = False
        self._last = math.nan  # clockwise from behind, so that it falls where a turn is cut
        self._began_ns = 0
        self._clear()

    def add(self, rays: Rays) -> list[Revolution]:
        """The turns that end within these rays; mostly none."""
        done = []
        for angle, range_m, intensity in zip(rays.angles_deg, rays.ranges_m, rays.intensities, strict=True):
            behind = (angle + 180.0) % 360.0
            if behind < self._last - 180.0:
                turn = self._cut(rays.stamp_ns)
                if turn is not None:
                    done.append(turn)
            self._last = behind
            if len(self._angles) >= MAX_RAYS:
                self.overlong_turns += 1
                self.restart()
            self._angles.append(angle)
            self._ranges.append(range_m)
            self._intensities.append(intensity)
        return done

    def restart(self) -> None:
        """Rays are missing here: the turn that has begun is no whole one."""
        self._whole = False
        self._last = math.nan
        self._clear()

    def _cut(self, stamp_ns: int) -> Revolution | None:
        whole, began_ns = self._whole, self._began_ns
        turn = None
        if whole and len(self._angles) < MIN_RAYS:
            self.short_turns += 1
        elif whole:
            turn = Revolution(
                angles_deg=np.array(self._angles, np.float64),
                ranges_m=np.array(self._ranges, np.float32),
                intensities=np.array(self._intensities, np.float32),
                began_ns=began_ns,
                ended_ns=max(stamp_ns, began_ns),
            )
        self._whole, self._began_ns = True, stamp_ns
        self._clear()
        return turn

    def _clear(self) -> None:
        self._angles: list[float] = []
        self._ranges: list[float] = []
        self._intensities: list[float] = []


def laser_scan(turn: Revolution, *, bins: int, range_min_m: float, range_max_m: float, frame_id: str) -> LaserScan:
    """The revolution in `bins` equal bins from -π on, counter-clockwise. What is nearer than `range_min_m` is -inf."""
    step = 2 * math.pi / bins
    angles = np.radians(-turn.angles_deg)
    places = np.round((angles + math.pi) / step).astype(np.int64) % bins
    valid = (turn.ranges_m > 0) & (turn.ranges_m <= range_max_m)
    measured = np.where(valid, turn.ranges_m, np.float32(np.inf))
    order = np.lexsort((measured, places))  # the nearest of a bin comes first
    there, first = np.unique(places[order], return_index=True)
    chosen = order[first]
    ranges = np.full(bins, np.nan, np.float32)
    nearest = measured[chosen]
    ranges[there] = np.where(nearest < range_min_m, np.float32(-np.inf), nearest)
    intensities = np.zeros(bins, np.float32)
    intensities[there] = turn.intensities[chosen]
    scan_s = (turn.ended_ns - turn.began_ns) / _SECOND_NS
    return LaserScan(
        header=header(turn.ended_ns, frame_id),
        angle_min=-math.pi,
        angle_max=-math.pi + (bins - 1) * step,
        angle_increment=step,
        time_increment=-scan_s / bins,
        scan_time=scan_s,
        range_min=range_min_m,
        range_max=range_max_m,
        ranges=ranges,
        intensities=intensities,
    )
