"""Cloud filters: bounds, sectors and voxels, and nothing that is no number."""

from __future__ import annotations

import numpy as np
import pytest

from metaros.drivers.vlp16.filters import CloudFilter, thinned
from metaros.drivers.vlp16.packets import POINT_DTYPE


def cloud(*points: tuple[float, float, float]) -> np.ndarray:
    made = np.zeros(len(points), POINT_DTYPE)
    for name, column in zip("xyz", np.array(points, np.float32).reshape(-1, 3).T, strict=True):
        made[name] = column
    made["ring"] = np.arange(len(points))
    return made


def kept(points: np.ndarray, **bounds: float) -> list[int]:
    """The numbers of the points that stay."""
    found: list[int] = CloudFilter(**bounds).apply(points)["ring"].tolist()
    return found


def test_without_bounds_it_is_the_same_array() -> None:
    points = cloud((1, 2, 3), (4, 5, 6))
    assert CloudFilter().apply(points) is points


def test_range_and_height() -> None:
    points = cloud((0.1, 0, 0), (0, 3, 4), (0, 0, 9), (5, 0, -1))
    assert kept(points, range_min_m=1.0) == [1, 2, 3]
    assert kept(points, range_max_m=5.0) == [0, 1]
    assert kept(points, z_min_m=0.0, z_max_m=4.0) == [0, 1]


@pytest.mark.parametrize(
    ("begin", "end", "stay"),
    [(-45, 45, [0]), (45, 135, [1]), (135, 225, [2]), (150, -150, [2]), (-180, 180, [0, 1, 2, 3]), (-100, -80, [3])],
)
def test_sectors_are_counter_clockwise_from_ahead(begin: float, end: float, stay: list[int]) -> None:
    points = cloud((1, 0, 0), (0, 1, 0), (-1, 0, 0), (0, -1, 0))
    assert kept(points, sector_from_deg=begin, sector_to_deg=end) == stay


def test_numbers_that_are_none_never_stay() -> None:
    points = cloud((np.nan, 0, 0), (np.inf, 0, 0), (0, 0, -np.inf), (1, 1, 1))
    assert kept(points) == [3]
    assert kept(points, voxel_m=0.1) == [3]


def test_one_point_a_voxel_the_first() -> None:
    points = cloud((0.01, 0, 0), (5, 5, 5), (0.09, 0.09, 0.09), (-0.01, 0, 0), (0.11, 0, 0))
    assert kept(points, voxel_m=0.1) == [0, 1, 3, 4]


def test_many_points_have_one_a_voxel() -> None:
    rng = np.random.default_rng(4)
    points = cloud(*rng.uniform(-3, 3, (5000, 3)))
    some = thinned(points, 0.5)
    cells = {tuple(np.floor([p["x"] / 0.5, p["y"] / 0.5, p["z"] / 0.5])) for p in some}
    every = {tuple(np.floor([p["x"] / 0.5, p["y"] / 0.5, p["z"] / 0.5])) for p in points}
    assert len(some) == len(cells)
    assert cells == every


def test_voxels_too_many_to_be_numbered() -> None:
    points = cloud((-3e38, -3e38, -3e38), (3e38, 3e38, 3e38), (1, 1, 1), (1, 1, 1))
    assert thinned(points, 0.001)["ring"].tolist() == [0, 1, 2]


def test_empty_clouds() -> None:
    assert len(CloudFilter(voxel_m=0.1, range_min_m=1).apply(cloud())) == 0
