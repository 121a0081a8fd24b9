"""The camera's picture: size, contents, other robots, and what happens without OpenCV."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from metaros.sim.camera import CAMERA, Renderer, make_renderer
from metaros.sim.fleet import Fleet
from metaros.sim.robot import Body
from metaros.sim.warehouse import WAREHOUSE
from metaros.sim.world import Circle


@pytest.fixture(scope="module")
def renderer() -> Renderer:
    pytest.importorskip("cv2")
    made = make_renderer()
    assert made is not None
    return made


@pytest.fixture
def body() -> Body:
    return Body(WAREHOUSE, x=6.0, y=5.4, heading_rad=0.0, charge=0.9)


def test_a_picture_of_an_aisle(renderer: Renderer, body: Body) -> None:
    picture = renderer.picture(body)
    assert picture.shape == (CAMERA.rows, CAMERA.columns, 3)
    assert picture.dtype == np.uint8
    assert picture.std() > 25
    floor, ceiling = picture[-20:, 140:180].astype(float), picture[:10, 140:180].astype(float)
    assert np.ptp(floor.mean(axis=(0, 1))) < 12  # concrete is grey
    assert floor.mean() > ceiling.mean()


def test_jpeg_is_small_and_decodes(renderer: Renderer) -> None:
    import cv2

    fleet = Fleet(robots=40, seed=2)
    sizes = []
    for robot in fleet.robots:
        jpeg = renderer.jpeg(robot.body, fleet.numbered_others(robot))
        decoded = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)
        assert decoded.shape == (240, 320, 3)
        sizes.append(len(jpeg))
    assert max(sizes) <= 15_000


def test_other_robots_are_seen_unless_hidden(renderer: Renderer, body: Body) -> None:
    empty = renderer.picture(body)
    ahead = renderer.picture(body, [(1, Circle(9.0, 5.4, 0.3))])
    behind = renderer.picture(body, [(1, Circle(3.0, 5.4, 0.3))])
    hidden = renderer.picture(body, [(1, Circle(9.0, 9.0, 0.3))])
    changed = np.abs(ahead.astype(int) - empty).max(axis=2) > 20
    assert 200 < changed.sum() < 10_000
    rows, columns = np.nonzero(changed)
    assert abs(columns.mean() - 160) < 6
    assert rows.min() > 100
    np.testing.assert_array_equal(behind, empty)
    np.testing.assert_array_equal(hidden, empty)


def test_a_nearer_robot_looks_larger(renderer: Renderer, body: Body) -> None:
    empty = renderer.picture(body)

    def pixels(x: float) -> int:
        seen = renderer.picture(body, [(1, Circle(x, 5.4, 0.3))])
        return int((np.abs(seen.astype(int) - empty).max(axis=2) > 20).sum())

    assert pixels(7.2) > pixels(9.0) > pixels(12.0) > 0


def test_a_picture_from_every_corner(renderer: Renderer) -> None:
    rng = np.random.default_rng(4)
    for _ in range(60):
        x, y, _ = WAREHOUSE.push_out(float(rng.uniform(0, 28)), float(rng.uniform(0, 18)), 0.3)
        body = Body(WAREHOUSE, x=x, y=y, heading_rad=float(rng.uniform(-3.1, 3.1)), charge=1.0)
        picture = renderer.picture(body)
        assert picture.max() > 40
        assert len(np.unique(picture)) > 15


def test_without_opencv_there_is_no_renderer(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "cv2", None)
    assert make_renderer() is None
