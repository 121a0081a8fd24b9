"""The painted surfaces: every kind of box has one, and painting is the same every time."""

from __future__ import annotations

import numpy as np

from metaros.sim.textures import ATLAS_ROWS, ceiling, floor, pack, paint_atlas
from metaros.sim.warehouse import WAREHOUSE


def test_every_box_has_a_surface_inside_the_atlas() -> None:
    atlas = paint_atlas(WAREHOUSE)
    assert atlas.pixels.shape[0] == ATLAS_ROWS
    assert {box.kind for box in WAREHOUSE.boxes} | {"robot"} == set(atlas.strips)
    for strips in atlas.strips.values():
        for strip in strips:
            assert max(strip.sharp, strip.blurred) + strip.columns <= atlas.pixels.shape[1]


def test_painting_is_repeatable() -> None:
    np.testing.assert_array_equal(paint_atlas(WAREHOUSE).pixels, paint_atlas(WAREHOUSE).pixels)
    np.testing.assert_array_equal(floor(WAREHOUSE), floor(WAREHOUSE))


def test_floor_and_ceiling_cover_the_room() -> None:
    assert floor(WAREHOUSE).shape == ceiling(WAREHOUSE).shape == (18 * 20, 28 * 20)


def test_only_a_robots_outline_is_see_through() -> None:
    atlas = paint_atlas(WAREHOUSE)
    hull = atlas.strips["robot"][0]
    assert (atlas.pixels[:, : hull.sharp] != 0).all()
    assert (atlas.pixels[0, hull.sharp : hull.sharp + 4] == 0).all()
    assert pack(np.zeros((1, 1, 3), np.uint8))[0, 0] != 0
