# ruff: noqa: A002
"""The messages of shape_msgs."""

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from metaros.idl import Message
from metaros.interfaces.geometry_msgs import msg as geometry_msgs_msg

class Mesh(Message):
    triangles: list[MeshTriangle]
    vertices: list[geometry_msgs_msg.Point]
    def __init__(
        self,
        *,
        triangles: list[MeshTriangle] = ...,
        vertices: list[geometry_msgs_msg.Point] = ...,
    ) -> None: ...

class MeshTriangle(Message):
    vertex_indices: npt.NDArray[np.uint32]
    def __init__(
        self,
        *,
        vertex_indices: npt.NDArray[Any] | Sequence[int] = ...,
    ) -> None: ...

class Plane(Message):
    coef: npt.NDArray[np.float64]
    def __init__(
        self,
        *,
        coef: npt.NDArray[Any] | Sequence[float] = ...,
    ) -> None: ...

class SolidPrimitive(Message):
    BOX: Final = 1
    SPHERE: Final = 2
    CYLINDER: Final = 3
    CONE: Final = 4
    PRISM: Final = 5
    BOX_X: Final = 0
    BOX_Y: Final = 1
    BOX_Z: Final = 2
    SPHERE_RADIUS: Final = 0
    CYLINDER_HEIGHT: Final = 0
    CYLINDER_RADIUS: Final = 1
    CONE_HEIGHT: Final = 0
    CONE_RADIUS: Final = 1
    PRISM_HEIGHT: Final = 0
    type: int
    dimensions: npt.NDArray[np.float64]
    polygon: geometry_msgs_msg.Polygon
    def __init__(
        self,
        *,
        type: int = ...,
        dimensions: npt.NDArray[Any] | Sequence[float] = ...,
        polygon: geometry_msgs_msg.Polygon = ...,
    ) -> None: ...
