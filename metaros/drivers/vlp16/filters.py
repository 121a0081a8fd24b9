"""Leaving out points of a cloud: by range, height, azimuth sector, and one point a voxel. Pure, by numpy."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

__all__ = ["CloudFilter", "thinned"]

Points = npt.NDArray[np.void]


@dataclass(frozen=True, slots=True, kw_only=True)
class CloudFilter:
    """What stays: metres and degrees, bounds included. Azimuths are counter-clockwise from ahead, as in ROS; a sector
    from 150 to -150 is the one behind. Points that are no numbers, or infinite, never stay.
    """

    range_min_m: float = 0.0
    range_max_m: float = np.inf
    z_min_m: float = -np.inf
    z_max_m: float = np.inf
    sector_from_deg: float = -180.0
    sector_to_deg: float = 180.0
    voxel_m: float = 0.0

    def apply(self, points: Points) -> Points:
        """The points that stay, in their order; the same array where all do."""
        x, y, z = (points[name].astype(np.float64, copy=False) for name in "xyz")
        with np.errstate(over="ignore", invalid="ignore"):
            squared = x * x + y * y + z * z
            stay = np.isfinite(squared)
            if self.range_min_m > 0:
                stay &= squared >= self.range_min_m**2
            if self.range_max_m < np.inf:
                stay &= squared <= self.range_max_m**2
            stay &= (z >= self.z_min_m) & (z <= self.z_max_m)
            stay &= self._in_sector(x, y)
        kept = points if stay.all() else points[stay]
        return thinned(kept, self.voxel_m) if self.voxel_m > 0 else kept

    def _in_sector(self, x: npt.NDArray[np.float64], y: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
        width = self.sector_to_deg - self.sector_from_deg
        if width >= 360:
            return np.ones(len(x), np.bool_)
        inside: npt.NDArray[np.bool_] = (np.degrees(np.arctan2(y, x)) - self.sector_from_deg) % 360 <= width % 360
        return inside


def thinned(points: Points, voxel_m: float) -> Points:
    """The first point of each cube of that size: points as they were measured, none averaged. Finite ones only."""
    if not len(points):
        return points
    cells = [np.floor(points[name].astype(np.float64) / voxel_m) for name in "xyz"]
    numbers = [cell - cell.min() for cell in cells]
    extents = [int(number.max()) + 1 for number in numbers]
    if extents[0] * extents[1] * extents[2] < 1 << 62:
        key = (numbers[0].astype(np.int64) * extents[1] + numbers[1].astype(np.int64)) * extents[2]
        _, first = np.unique(key + numbers[2].astype(np.int64), return_index=True)
    else:  # voxels too small for so wide a cloud to be numbered
        _, first = np.unique(np.stack(numbers, axis=1), axis=0, return_index=True)
    return points[np.sort(first)]
