"""Turns of a lidar: cut behind, whole ones only, counter-clockwise bins whose times fit their stamps."""

from __future__ import annotations

import math

import numpy as np
import pytest

from metaros.drivers.lidar_scans import MAX_RAYS, Rays, Revolution, ScanAssembler, laser_scan
from tests.support.devices.room import AHEAD_M, BEHIND_M, LEFT_M, RIGHT_M, distances_m

SECOND = 1_000_000_000


def rays(angles: list[float], stamp_ns: int, ranges: list[float] | None = None) -> Rays:
    measured = distances_m(angles) if ranges is None else ranges
    return Rays(angles_deg=angles, ranges_m=measured, intensities=[9.0] * len(angles), stamp_ns=stamp_ns)


def turned(assembler: ScanAssembler, turns: int, *, begin_deg: float = 0.0) -> list[Revolution]:
    """Ten rays every 2 ms, one a degree."""
    done, stamp = [], 0
    for step in range(36 * turns + 1):
        stamp += SECOND // 500
        done += assembler.add(rays([(begin_deg + 10 * step + index) % 360 for index in range(10)], stamp))
    return done


def scan_of(turn: Revolution, bins: int = 360) -> object:
    return laser_scan(turn, bins=bins, range_min_m=0.1, range_max_m=12.0, frame_id="laser")


def test_the_part_before_the_first_cut_is_no_turn() -> None:
    assert len(turned(ScanAssembler(), 3)) == 2
    assert len(turned(ScanAssembler(), 3, begin_deg=180)) == 2  # whether anything was before is not known


def test_a_scan_has_the_room_counter_clockwise() -> None:
    (turn, *_) = turned(ScanAssembler(), 3)
    scan = scan_of(turn)
    assert scan.angle_min == pytest.approx(-math.pi)
    assert scan.angle_max == pytest.approx(math.pi - 2 * math.pi / 360, abs=1e-5)
    at = {degrees: scan.ranges[(degrees + 180) % 360] for degrees in (0, 90, 180, -90)}
    assert at == pytest.approx({0: AHEAD_M, 90: LEFT_M, 180: BEHIND_M, -90: RIGHT_M}, rel=1e-3)
    assert scan.header.frame_id == "laser"
    assert set(scan.intensities) == {9.0}


def test_ray_i_was_measured_at_stamp_plus_i_increments() -> None:
    (turn, *_) = turned(ScanAssembler(), 3)
    scan = scan_of(turn)
    stamp_ns = scan.header.stamp.sec * SECOND + scan.header.stamp.nanosec
    assert stamp_ns == turn.ended_ns
    assert scan.scan_time == pytest.approx(0.072)
    last_ns = stamp_ns + (len(scan.ranges) - 1) * scan.time_increment * SECOND
    assert last_ns == pytest.approx(turn.began_ns, abs=SECOND / 1000)  # the ray left of behind came first


def test_bins_without_a_ray_are_nan_those_without_a_return_inf() -> None:
    angles = [180.0 + 2 * index for index in range(180)]
    turn = Revolution(
        angles_deg=np.array(angles),
        ranges_m=np.array([0.0, 0.05, 99.0] + [1.0] * 177, np.float32),
        intensities=np.ones(180, np.float32),
        began_ns=0,
        ended_ns=SECOND,
    )
    ranges = scan_of(turn).ranges
    assert np.isnan(ranges).sum() == 180
    assert [ranges[0], ranges[-2], ranges[-4]] == [math.inf, -math.inf, math.inf]
    assert (ranges == 1.0).sum() == 177


def test_the_nearest_of_a_bin_counts() -> None:
    turn = Revolution(
        angles_deg=np.array([0.0, 0.1, 0.2, 0.3]),
        ranges_m=np.array([5.0, 0.0, 2.0, 3.0], np.float32),
        intensities=np.array([1, 2, 3, 4], np.float32),
        began_ns=0,
        ended_ns=SECOND,
    )
    scan = scan_of(turn, bins=36)
    assert (scan.ranges[18], scan.intensities[18]) == (2.0, 3.0)


def test_after_a_gap_the_begun_turn_is_none() -> None:
    assembler = ScanAssembler()
    turned(assembler, 2)
    assembler.restart()
    assert assembler.add(rays([170.0, 175.0, 185.0, 190.0], SECOND)) == []


def test_a_stumble_of_the_angle_is_no_turn() -> None:
    assembler = ScanAssembler()
    assembler.add(rays([170.0, 190.0], 1))
    assert assembler.add(rays([170.0, 190.0, 200.0], 2)) == []
    assert assembler.short_turns == 1


def test_an_angle_that_stands_still_does_not_fill_the_memory() -> None:
    assembler = ScanAssembler()
    for stamp in range(2 * MAX_RAYS // 100 + 2):
        assert assembler.add(rays([42.0] * 100, stamp, [1.0] * 100)) == []
    assert assembler.overlong_turns == 2
