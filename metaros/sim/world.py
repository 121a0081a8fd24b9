"""The warehouse: axis-aligned boxes in a room, with vectorised ray casting and collision.

Rays meet only faces that look at them, so a ray from inside a box passes through it; robots are kept outside by
`push_out`. Lengths are metres, angles radians, the origin is the room's south-west corner.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

__all__ = ["Box", "Circle", "Floats", "Hits", "World", "ray_table"]

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Box:
    """A solid block on the floor, or (`kind` "room") the room whose walls look inwards."""

    kind: str
    x_min: float
    y_min: float
    x_max: float
    y_max: float
    height_m: float


@dataclass(frozen=True, slots=True)
class Circle:
    """A round obstacle that moves: another robot."""

    x: float
    y: float
    radius_m: float


@dataclass(frozen=True, slots=True)
class Hits:
    """What each ray met first: its range (inf: nothing), the box (-1), metres along its face, whether it faces x."""

    range_m: Floats
    box: Ints
    along_m: Floats
    across_x: npt.NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class _Faces:
    """All faces across one axis: where they stand, how far they reach, which way they look, whose they are."""

    at: Floats
    low: Floats
    high: Floats
    outward: Floats
    box: Ints


def ray_table(count: int, *, first_rad: float, step_rad: float) -> Floats:
    """Unit directions of `count` rays in the robot's frame, shape (2, count)."""
    angles = first_rad + step_rad * np.arange(count)
    return np.stack((np.cos(angles), np.sin(angles)))


def _faces(boxes: tuple[Box, ...], *, across_x: bool) -> _Faces:
    rows: list[tuple[float, float, float, float, int]] = []
    for index, box in enumerate(boxes):
        sign = -1.0 if box.kind == "room" else 1.0
        near, far = (box.x_min, box.x_max) if across_x else (box.y_min, box.y_max)
        low, high = (box.y_min, box.y_max) if across_x else (box.x_min, box.x_max)
        rows.append((near, low, high, -sign, index))
        rows.append((far, low, high, sign, index))
    table = np.array(rows, dtype=np.float64).reshape(-1, 5)
    return _Faces(table[:, 0], table[:, 1], table[:, 2], table[:, 3], table[:, 4].astype(np.int64))


class World:
    """An immutable table of boxes, exactly one of them the room."""

    def __init__(self, boxes: tuple[Box, ...]) -> None:
        rooms = [box for box in boxes if box.kind == "room"]
        if len(rooms) != 1:
            raise ValueError(f"a world has exactly one room, not {len(rooms)}")
        self.room = rooms[0]
        self.boxes = boxes
        self._faces_x = _faces(boxes, across_x=True)
        self._faces_y = _faces(boxes, across_x=False)
        solid = [box for box in boxes if box.kind != "room"]
        self._solid = tuple((box.x_min, box.y_min, box.x_max, box.y_max) for box in solid)
        self._near: dict[tuple[int, int, float], list[tuple[float, float, float, float]]] = {}
        self._low = np.array([(box.x_min, box.y_min) for box in solid], dtype=np.float64).reshape(-1, 2)
        self._high = np.array([(box.x_max, box.y_max) for box in solid], dtype=np.float64).reshape(-1, 2)

    def cast(
        self, x: float, y: float, heading_rad: float, rays: Floats, *, max_m: float, others: tuple[Circle, ...] = ()
    ) -> Floats:
        """Distance to the first surface along each ray of `ray_table`, inf beyond `max_m`."""
        dx, dy = _turned(rays, heading_rad)
        first_x, _, _ = _nearest(self._faces_x, x, y, dx, dy, max_m)
        first_y, _, _ = _nearest(self._faces_y, y, x, dy, dx, max_m)
        ranges = np.minimum(first_x, first_y)
        for circle in others:
            ranges = np.minimum(ranges, _to_circle(circle, x, y, dx, dy, max_m))
        ranges[ranges > max_m] = np.inf
        return ranges

    def look(self, x: float, y: float, heading_rad: float, rays: Floats, *, max_m: float) -> Hits:
        """The same with what was met, for pictures; robots are not in it."""
        dx, dy = _turned(rays, heading_rad)
        first_x, face_x, at_y = _nearest(self._faces_x, x, y, dx, dy, max_m)
        first_y, face_y, at_x = _nearest(self._faces_y, y, x, dy, dx, max_m)
        by_x = first_x <= first_y
        ranges = np.where(by_x, first_x, first_y)
        met = np.isfinite(ranges) & (ranges <= max_m)
        box = np.where(by_x, self._faces_x.box[face_x], self._faces_y.box[face_y])
        along = np.where(by_x, at_y - self._faces_x.low[face_x], at_x - self._faces_y.low[face_y])
        return Hits(np.where(met, ranges, np.inf), np.where(met, box, -1), np.where(met, along, 0.0), by_x)

    def push_out(self, x: float, y: float, radius_m: float) -> tuple[float, float, bool]:
        """The nearest place where a disc fits, and whether it had to move. Three rounds settle any corner here."""
        touched = False
        for _ in range(3):
            inside_x = min(max(x, self.room.x_min + radius_m), self.room.x_max - radius_m)
            inside_y = min(max(y, self.room.y_min + radius_m), self.room.y_max - radius_m)
            moved = inside_x != x or inside_y != y
            x, y = inside_x, inside_y
            step = self._out_of_box(x, y, radius_m)
            if step is not None:
                x, y, moved = x + step[0], y + step[1], True
            if not moved:
                break
            touched = True
        return x, y, touched

    def clearance(self, x: float, y: float) -> float:
        """Distance from a point to the nearest surface; negative inside a box or outside the room."""
        room = self.room
        to_wall = min(x - room.x_min, room.x_max - x, y - room.y_min, room.y_max - y)
        if not len(self._low):
            return to_wall
        point = np.array((x, y))
        gap = np.maximum(self._low - point, point - self._high)
        outside = np.hypot(*np.maximum(gap, 0.0).T)
        signed = np.where(gap.max(axis=1) < 0.0, gap.max(axis=1), outside)
        return min(to_wall, float(signed.min()))

    def sees(self, x: float, y: float, to_x: float, to_y: float) -> bool:
        """Whether a straight line between two points meets no box."""
        distance = math.hypot(to_x - x, to_y - y)
        if distance == 0.0:
            return True
        ray = np.array([[(to_x - x) / distance], [(to_y - y) / distance]])
        return bool(self.cast(x, y, 0.0, ray, max_m=distance)[0] >= distance)

    def _solid_near(self, column: int, row: int, radius_m: float) -> list[tuple[float, float, float, float]]:
        """The boxes that a disc with its middle in that square metre may overlap."""
        key = (column, row, radius_m)
        if key not in self._near:
            self._near[key] = [
                (x_min, y_min, x_max, y_max)
                for x_min, y_min, x_max, y_max in self._solid
                if x_min - radius_m <= column + 1
                and column <= x_max + radius_m
                and y_min - radius_m <= row + 1
                and row <= y_max + radius_m
            ]
        return self._near[key]

    def _out_of_box(self, x: float, y: float, radius_m: float) -> tuple[float, float] | None:
        """The step that takes a disc out of the box it overlaps most, if any."""
        near = False
        for x_min, y_min, x_max, y_max in self._solid_near(math.floor(x), math.floor(y), radius_m):
            near |= x_min - radius_m <= x <= x_max + radius_m and y_min - radius_m <= y <= y_max + radius_m
        if not near:  # nearly always, and for a twentieth of what the rest costs
            return None
        point = np.array((x, y))
        away = point - np.clip(point, self._low, self._high)
        distance = np.hypot(away[:, 0], away[:, 1])
        worst = int(distance.argmin())
        gap = float(distance[worst])
        if gap >= radius_m:
            return None
        if gap > 1e-9:
            push = (radius_m - gap) / gap
            return float(away[worst, 0]) * push, float(away[worst, 1]) * push
        x_min, y_min, x_max, y_max = self._solid[worst]
        exits = ((x_min - radius_m - x, 0.0), (x_max + radius_m - x, 0.0), (0.0, y_min - radius_m - y))
        shortest = min((*exits, (0.0, y_max + radius_m - y)), key=lambda step: abs(step[0]) + abs(step[1]))
        return shortest


def _turned(rays: Floats, heading_rad: float) -> tuple[Floats, Floats]:
    """Ray directions in the world's frame; exact zeros are nudged so that no division fails."""
    cos, sin = math.cos(heading_rad), math.sin(heading_rad)
    dx = cos * rays[0] - sin * rays[1]
    dy = sin * rays[0] + cos * rays[1]
    dx[dx == 0.0] = 1e-12
    dy[dy == 0.0] = 1e-12
    return dx, dy


def _nearest(
    faces: _Faces, here: float, side: float, ahead: Floats, sideways: Floats, max_m: float
) -> tuple[Floats, Ints, Floats]:
    """Per ray: the distance to the nearest face of one axis, the face's index and where on the other axis it is met."""
    offset = faces.at - here
    looks_here = offset * faces.outward < 0.0
    in_reach = (np.abs(offset) <= max_m) & (faces.low - side <= max_m) & (side - faces.high <= max_m)
    chosen = np.flatnonzero(looks_here & in_reach)
    if not len(chosen):
        return np.full(len(ahead), np.inf), np.zeros(len(ahead), dtype=np.int64), np.zeros(len(ahead))
    distance = offset[chosen, None] / ahead
    met_at = distance * sideways
    met_at += side
    miss = (distance <= 0.0) | (met_at < faces.low[chosen, None]) | (met_at > faces.high[chosen, None])
    distance[miss] = np.inf
    first = distance.argmin(axis=0)
    column = np.arange(len(ahead))
    return distance[first, column], chosen[first], met_at[first, column]


def _to_circle(circle: Circle, x: float, y: float, dx: Floats, dy: Floats, max_m: float) -> Floats:
    """Distance along each ray to a circle's near side, inf where it is missed or the ray starts inside."""
    to_x, to_y = circle.x - x, circle.y - y
    reach = math.hypot(to_x, to_y)
    if reach - circle.radius_m > max_m or reach <= circle.radius_m:
        return np.full(len(dx), np.inf)
    along = to_x * dx + to_y * dy
    aside = to_x * dy - to_y * dx
    depth = circle.radius_m**2 - aside * aside
    near = along - np.sqrt(np.maximum(depth, 0.0))
    return np.where((depth >= 0.0) & (near > 0.0), near, np.inf)
