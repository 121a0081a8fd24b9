"""Ray casting against distances known by geometry, collision, and the speed of a scan."""

from __future__ import annotations

import math

import numpy as np
import pytest

from metaros.sim.warehouse import CROSSINGS, NEIGHBOURS, WAREHOUSE, start_places
from metaros.sim.world import Box, Circle, World, ray_table

ROOM = Box("room", 0.0, 0.0, 10.0, 6.0, 3.0)
RACK = Box("rack", 4.0, 2.0, 6.0, 3.0, 2.0)
WORLD = World((ROOM, RACK))
CROSS = ray_table(4, first_rad=0.0, step_rad=math.pi / 2)  # ahead, left, behind, right


def test_rays_meet_walls_and_boxes() -> None:
    ranges = WORLD.cast(2.0, 2.5, 0.0, CROSS, max_m=20.0)
    np.testing.assert_allclose(ranges, [2.0, 3.5, 2.0, 2.5], atol=1e-9)


def test_rays_turn_with_the_robot() -> None:
    ranges = WORLD.cast(2.0, 2.5, math.pi / 2, CROSS, max_m=20.0)
    np.testing.assert_allclose(ranges, [3.5, 2.0, 2.5, 2.0], atol=1e-9)


def test_a_slanted_ray_is_as_long_as_pythagoras_says() -> None:
    ray = np.array([[0.6], [0.8]])
    assert WORLD.cast(1.0, 2.0, 0.0, ray, max_m=20.0)[0] == pytest.approx(5.0)


def test_nothing_within_reach_is_infinite() -> None:
    assert np.isinf(WORLD.cast(2.0, 2.5, 0.0, CROSS, max_m=1.5)).all()


def test_other_robots_are_round_and_hide_what_is_behind() -> None:
    other = Circle(3.0, 2.5, 0.3)
    ranges = WORLD.cast(2.0, 2.5, 0.0, CROSS, max_m=20.0, others=(other,))
    np.testing.assert_allclose(ranges, [0.7, 3.5, 2.0, 2.5], atol=1e-9)
    edge = math.asin(0.3)  # the tangent touches the circle at the end of a right-angled triangle
    grazing = np.array([[math.cos(edge * 0.999)], [math.sin(edge * 0.999)]])
    assert WORLD.cast(2.0, 2.5, 0.0, grazing, max_m=20.0, others=(other,))[0] == pytest.approx(math.cos(edge), abs=0.02)
    beside = np.array([[math.cos(edge * 1.01)], [math.sin(edge * 1.01)]])
    assert WORLD.cast(2.0, 2.5, 0.0, beside, max_m=20.0, others=(other,))[0] > 1.5


def test_every_ray_agrees_with_marching_along_it() -> None:
    rays = ray_table(90, first_rad=-math.pi, step_rad=math.tau / 90)
    for x, y, heading in ((2.1, 1.8, 0.3), (14.0, 9.0, 2.0), (9.0, 5.4, -1.0)):
        ranges = WAREHOUSE.cast(x, y, heading, rays, max_m=30.0)
        for (dx, dy), measured in zip(rays.T, ranges, strict=True):
            cos, sin = math.cos(heading), math.sin(heading)
            ux, uy = cos * dx - sin * dy, sin * dx + cos * dy
            walked = 0.0
            while (clear := WAREHOUSE.clearance(x + ux * walked, y + uy * walked)) > 1e-4:
                walked += clear
            assert measured == pytest.approx(walked, abs=0.02)


def test_look_says_what_was_met_and_where() -> None:
    hits = WORLD.look(2.0, 2.5, 0.0, CROSS, max_m=20.0)
    assert list(hits.box) == [1, 0, 0, 0]
    np.testing.assert_allclose(hits.along_m, [0.5, 2.0, 2.5, 2.0], atol=1e-9)
    assert list(hits.across_x) == [True, False, True, False]
    assert list(WORLD.look(2.0, 2.5, 0.0, CROSS, max_m=1.0).box) == [-1] * 4


@pytest.mark.parametrize(
    ("start", "settled"),
    [
        ((2.0, 1.0), (2.0, 1.0)),
        ((0.1, 1.0), (0.3, 1.0)),
        ((3.9, 2.5), (3.7, 2.5)),
        ((5.0, 3.1), (5.0, 3.3)),
        ((4.1, 2.5), (3.7, 2.5)),
        ((-1.0, 9.0), (0.3, 5.7)),
    ],
)
def test_push_out(start: tuple[float, float], settled: tuple[float, float]) -> None:
    x, y, touched = WORLD.push_out(*start, 0.3)
    assert (x, y) == pytest.approx(settled)
    assert touched == (start != settled)
    assert WORLD.clearance(x, y) >= 0.3 - 1e-9


def test_sees() -> None:
    assert WORLD.sees(1.0, 1.0, 9.0, 1.0)
    assert not WORLD.sees(1.0, 2.5, 9.0, 2.5)
    assert WORLD.sees(1.0, 1.0, 1.0, 1.0)


def test_a_world_has_one_room() -> None:
    with pytest.raises(ValueError, match="exactly one room"):
        World((RACK,))


def test_an_empty_room_works() -> None:
    room = World((ROOM,))
    assert room.push_out(0.0, 3.0, 0.5) == (0.5, 3.0, True)
    assert room.clearance(1.0, 3.0) == 1.0


def test_the_streets_are_wide_enough() -> None:
    """Two robots of 0.3 m radius pass each other at half a metre either side of every street's middle."""
    for node, (x, y) in enumerate(CROSSINGS):
        for neighbour in NEIGHBOURS[node]:
            to_x, to_y = CROSSINGS[neighbour]
            assert node in NEIGHBOURS[neighbour]
            for step in np.linspace(0.0, 1.0, 60):
                assert WAREHOUSE.clearance(x + (to_x - x) * step, y + (to_y - y) * step) > 0.5 + 0.3 + 0.1


def test_start_places_are_free_and_apart() -> None:
    places = start_places()
    assert len(places) == len(set(places)) >= 50
    assert min(WAREHOUSE.clearance(*place) for place in places) > 0.5
    gaps = [math.dist(a, b) for i, a in enumerate(places) for b in places[:i]]
    assert min(gaps) > 1.0
