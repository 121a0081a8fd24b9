"""The robot's forward camera: a ray-cast picture of the warehouse, 320 x 240, as JPEG.

Each picture column is one ray for every height of box there is; the boxes of one height make a layer (the nearest
hides the others), layers meet in a depth buffer, and floor and ceiling fill what is left. Needs OpenCV, for the
JPEG above all; `make_renderer` returns None where it is missing.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from metaros.sim import textures
from metaros.sim.robot import Body
from metaros.sim.textures import ATLAS_ROWS, FLOOR_PX_PER_M, PX_PER_M, ROBOT_HEIGHT_M, Atlas
from metaros.sim.warehouse import WAREHOUSE
from metaros.sim.world import Circle, World

__all__ = ["CAMERA", "CameraSpec", "Renderer", "make_renderer"]

Words = npt.NDArray[np.uint32]
Floats32 = npt.NDArray[np.float32]
Columns = npt.NDArray[np.int32]
_NOWHERE = 1e6  # the depth of a column without a hit


@dataclass(frozen=True, slots=True)
class CameraSpec:
    """Where the camera looks from and what it makes."""

    columns: int = 320
    rows: int = 240
    field_of_view_rad: float = math.radians(80.0)
    height_m: float = 0.6
    forward_m: float = 0.2
    horizon_row: float = 104.5
    rate_hz: float = 10.0
    quality: int = 60
    reach_m: float = 34.0
    sharp_m: float = 7.0  # nearer surfaces use the sharp copy
    dim_m: float = 17.0  # what is so far away is half as bright


CAMERA = CameraSpec()


@dataclass(frozen=True, slots=True)
class _Layer:
    """One surface a column: its depth along the view, its column in the atlas, its brightness, and its height."""

    depth_m: Floats32
    column: Columns
    light: Floats32
    height_m: float


@dataclass(frozen=True, slots=True, kw_only=True)
class _Boxes:
    """The room with the boxes of one height, and by box: whether it is painted here, and where its surface lies."""

    world: World
    height_m: float
    painted: npt.NDArray[np.bool_]
    sharp: npt.NDArray[np.int64]
    blurred: npt.NDArray[np.int64]
    columns: npt.NDArray[np.int64]


class Renderer:
    """Paints what a camera sees. One serves all robots: it holds the painted surfaces and scratch space."""

    def __init__(self, cv2: Any, *, world: World = WAREHOUSE, spec: CameraSpec = CAMERA) -> None:
        self._cv2 = cv2
        cv2.setNumThreads(1)  # a pool of threads for pictures this small only costs
        self._spec = spec
        self._atlas = textures.paint_atlas(world)
        self._floor, self._ceiling = textures.floor(world), textures.ceiling(world)
        self._boxes = _by_height(world, self._atlas)
        focal = spec.columns / 2 / math.tan(spec.field_of_view_rad / 2)
        across = (spec.columns / 2 - 0.5 - np.arange(spec.columns)) / focal
        self._rays = np.stack((np.ones(spec.columns), across)) / np.hypot(1.0, across)
        slope = (spec.horizon_row - np.arange(spec.rows)) / focal
        self._slope = slope.astype(np.float32)[:, None]
        to_plane = np.where(slope > 0, world.room.height_m - spec.height_m, spec.height_m) / np.abs(slope)
        self._plane_depth = np.repeat(to_plane.astype(np.float32)[:, None], spec.columns, axis=1).ravel()
        self._plane_aside = (to_plane[:, None] * across).astype(np.float32).ravel()
        self._above = math.ceil(spec.horizon_row) * spec.columns

    def jpeg(self, body: Body, others: Sequence[tuple[int, Circle]] = ()) -> bytes:
        """The picture as JPEG; see `picture`."""
        options = [self._cv2.IMWRITE_JPEG_QUALITY, self._spec.quality]
        done, encoded = self._cv2.imencode(".jpg", self.picture(body, others), options)
        if not done:
            raise RuntimeError("OpenCV could not encode a JPEG")
        return bytes(encoded)

    def picture(self, body: Body, others: Sequence[tuple[int, Circle]] = ()) -> npt.NDArray[np.uint8]:
        """What the camera of `body` sees, BGR; `others` are (number, outline) of the other robots."""
        spec = self._spec
        x = body.x + spec.forward_m * math.cos(body.heading_rad)
        y = body.y + spec.forward_m * math.sin(body.heading_rad)
        image = np.zeros((spec.rows, spec.columns), dtype=np.uint32)
        depth = np.full((spec.rows, spec.columns), _NOWHERE, dtype=np.float32)
        light = np.ones((spec.rows, spec.columns), dtype=np.float32)
        for layer in self._layers(x, y, body.heading_rad, others):
            self._paint(layer, image, depth, light)
        self._fill(image, depth, x, y, body.heading_rad)
        light /= 1.0 + np.square(depth * (1.0 / spec.dim_m))
        shaded: npt.NDArray[np.uint8] = self._cv2.cvtColor(_shade(image, light), self._cv2.COLOR_BGRA2BGR)
        return shaded

    def _layers(self, x: float, y: float, heading_rad: float, others: Sequence[tuple[int, Circle]]) -> list[_Layer]:
        layers = []
        for boxes in self._boxes:
            layer = self._box_layer(boxes, (x, y, heading_rad))
            if layer is not None:
                layers.append(layer)
        for number, circle in others:
            layer = self._robot_layer(number, circle, (x, y, heading_rad))
            if layer is not None:
                layers.append(layer)
        return layers

    def _box_layer(self, boxes: _Boxes, eye: tuple[float, float, float]) -> _Layer | None:
        hits = boxes.world.look(*eye, self._rays, max_m=self._spec.reach_m)
        met = (hits.box >= 0) & boxes.painted[hits.box]
        if not met.any():
            return None
        depth = np.where(met, hits.range_m * self._rays[0], _NOWHERE).astype(np.float32)
        along = (hits.along_m * PX_PER_M).astype(np.int64) % boxes.columns[hits.box]
        column = np.where(depth < self._spec.sharp_m, boxes.sharp[hits.box], boxes.blurred[hits.box]) + along
        light = np.where(hits.across_x, 0.82, 1.0).astype(np.float32)
        return _Layer(depth, column.astype(np.int32), light, boxes.height_m)

    def _robot_layer(self, number: int, circle: Circle, eye: tuple[float, float, float]) -> _Layer | None:
        """A robot as an upright disc that faces the camera, at the depth of its near side."""
        x, y, heading = eye
        cos, sin = math.cos(heading), math.sin(heading)
        ahead = cos * (circle.x - x) + sin * (circle.y - y)
        aside = cos * (circle.y - y) - sin * (circle.x - x)
        if ahead < circle.radius_m + 0.05:
            return None
        offset = aside - self._rays[1] / self._rays[0] * ahead
        met = np.abs(offset) < circle.radius_m
        if not met.any():
            return None
        strip = self._atlas.strip("robot", number)
        depth = np.where(met, ahead - circle.radius_m, _NOWHERE).astype(np.float32)
        column = strip.sharp + np.clip((offset / circle.radius_m + 1.0) * strip.columns / 2, 0, strip.columns - 1)
        return _Layer(depth, column.astype(np.int32), np.ones(len(depth), dtype=np.float32), ROBOT_HEIGHT_M)

    def _paint(self, layer: _Layer, image: Words, depth: Floats32, light: Floats32) -> None:
        """Draw a layer where it is nearer than what is there, within the rows and columns it can reach."""
        hit = np.flatnonzero(layer.depth_m < _NOWHERE)
        columns = slice(int(hit[0]), int(hit[-1]) + 1)
        far = layer.depth_m[columns]
        spec = self._spec
        nearest = float(far.min())
        focal = 1.0 / float(self._slope[0, 0] - self._slope[1, 0])
        top = max(0, int(spec.horizon_row - max(layer.height_m - spec.height_m, 0.0) * focal / nearest))
        bottom = min(spec.rows, int(spec.horizon_row + spec.height_m * focal / nearest) + 2)
        rows = slice(top, bottom)
        at_m = spec.height_m + self._slope[rows] * far
        here = depth[rows, columns]
        drawn = (at_m >= 0.0) & (at_m <= layer.height_m) & (far < here)
        row = ((layer.height_m - at_m) * ((ATLAS_ROWS - 1) / layer.height_m)).astype(np.int32)
        np.clip(row, 0, ATLAS_ROWS - 1, out=row)
        row *= self._atlas.pixels.shape[1]
        row += layer.column[columns]
        pixels = self._atlas.pixels.ravel().take(row)
        drawn &= pixels != 0
        np.copyto(image[rows, columns], pixels, where=drawn)
        np.copyto(here, np.broadcast_to(far, here.shape), where=drawn)
        np.copyto(light[rows, columns], np.broadcast_to(layer.light[columns], here.shape), where=drawn)

    def _fill(self, image: Words, depth: Floats32, x: float, y: float, heading_rad: float) -> None:
        """Floor and ceiling where nothing stands."""
        cos, sin = math.cos(heading_rad), math.sin(heading_rad)
        flat_image, flat_depth = image.ravel(), depth.ravel()
        free = np.flatnonzero(flat_depth >= _NOWHERE)
        split = int(np.searchsorted(free, self._above))
        for plane, picture in ((free[:split], self._ceiling), (free[split:], self._floor)):
            ahead, aside = self._plane_depth[plane], self._plane_aside[plane]
            column = ((x + cos * ahead - sin * aside) * FLOOR_PX_PER_M).astype(np.int32)
            row = ((y + sin * ahead + cos * aside) * FLOOR_PX_PER_M).astype(np.int32)
            np.clip(column, 0, picture.shape[1] - 1, out=column)
            np.clip(row, 0, picture.shape[0] - 1, out=row)
            flat_image[plane] = picture[row, column]
            flat_depth[plane] = ahead


def _shade(image: Words, light: Floats32) -> npt.NDArray[np.uint8]:
    """Multiply packed pixels by 0..1: blue and red in one go, green in another; gives rows x columns x BGRX."""
    factor = (np.maximum(light, 0.2) * 256.0).astype(np.uint32)
    red_blue = ((image & 0x00FF00FF) * factor >> 8) & 0x00FF00FF
    green = ((image & 0x0000FF00) * factor >> 8) & 0x0000FF00
    return (red_blue | green).view(np.uint8).reshape(*image.shape, 4)


def _by_height(world: World, atlas: Atlas) -> list[_Boxes]:
    """One entry for each height of box, the highest first."""
    layers = []
    for height_m in sorted({box.height_m for box in world.boxes}, reverse=True):
        kept = [(i, box) for i, box in enumerate(world.boxes) if box.kind == "room" or box.height_m == height_m]
        strips = [atlas.strip(box.kind, i) for i, box in kept]
        layers.append(
            _Boxes(
                world=World(tuple(box for _, box in kept)),
                height_m=height_m,
                painted=np.array([box.height_m == height_m for _, box in kept]),
                sharp=np.array([strip.sharp for strip in strips]),
                blurred=np.array([strip.blurred for strip in strips]),
                columns=np.array([strip.columns for strip in strips]),
            )
        )
    return layers


def make_renderer(*, world: World = WAREHOUSE) -> Renderer | None:
    """A renderer, or None where OpenCV is not installed."""
    try:
        cv2 = importlib.import_module("cv2")
    except ImportError:
        return None
    return Renderer(cv2, world=world)
