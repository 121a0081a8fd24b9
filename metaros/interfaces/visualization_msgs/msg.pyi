# ruff: noqa: A002
"""The messages of visualization_msgs."""

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from metaros.idl import Message
from metaros.interfaces.builtin_interfaces import msg as builtin_interfaces_msg
from metaros.interfaces.geometry_msgs import msg as geometry_msgs_msg
from metaros.interfaces.sensor_msgs import msg as sensor_msgs_msg
from metaros.interfaces.std_msgs import msg as std_msgs_msg

class ImageMarker(Message):
    CIRCLE: Final = 0
    LINE_STRIP: Final = 1
    LINE_LIST: Final = 2
    POLYGON: Final = 3
    POINTS: Final = 4
    ADD: Final = 0
    REMOVE: Final = 1
    header: std_msgs_msg.Header
    ns: str
    id: int
    type: int
    action: int
    position: geometry_msgs_msg.Point
    scale: float
    outline_color: std_msgs_msg.ColorRGBA
    filled: int
    fill_color: std_msgs_msg.ColorRGBA
    lifetime: builtin_interfaces_msg.Duration
    points: list[geometry_msgs_msg.Point]
    outline_colors: list[std_msgs_msg.ColorRGBA]
    def __init__(
        self,
        *,
        header: std_msgs_msg.Header = ...,
        ns: str = ...,
        id: int = ...,
        type: int = ...,
        action: int = ...,
        position: geometry_msgs_msg.Point = ...,
        scale: float = ...,
        outline_color: std_msgs_msg.ColorRGBA = ...,
        filled: int = ...,
        fill_color: std_msgs_msg.ColorRGBA = ...,
        lifetime: builtin_interfaces_msg.Duration = ...,
        points: list[geometry_msgs_msg.Point] = ...,
        outline_colors: list[std_msgs_msg.ColorRGBA] = ...,
    ) -> None: ...

class InteractiveMarker(Message):
    header: std_msgs_msg.Header
    pose: geometry_msgs_msg.Pose
    name: str
    description: str
    scale: float
    menu_entries: list[MenuEntry]
    controls: list[InteractiveMarkerControl]
    def __init__(
        self,
        *,
        header: std_msgs_msg.Header = ...,
        pose: geometry_msgs_msg.Pose = ...,
        name: str = ...,
        description: str = ...,
        scale: float = ...,
        menu_entries: list[MenuEntry] = ...,
        controls: list[InteractiveMarkerControl] = ...,
    ) -> None: ...

class InteractiveMarkerControl(Message):
    INHERIT: Final = 0
    FIXED: Final = 1
    VIEW_FACING: Final = 2
    NONE: Final = 0
    MENU: Final = 1
    BUTTON: Final = 2
    MOVE_AXIS: Final = 3
    MOVE_PLANE: Final = 4
    ROTATE_AXIS: Final = 5
    MOVE_ROTATE: Final = 6
    MOVE_3D: Final = 7
    ROTATE_3D: Final = 8
    MOVE_ROTATE_3D: Final = 9
    name: str
    orientation: geometry_msgs_msg.Quaternion
    orientation_mode: int
    interaction_mode: int
    always_visible: bool
    markers: list[Marker]
    independent_marker_orientation: bool
    description: str
    def __init__(
        self,
        *,
        name: str = ...,
        orientation: geometry_msgs_msg.Quaternion = ...,
        orientation_mode: int = ...,
        interaction_mode: int = ...,
        always_visible: bool = ...,
        markers: list[Marker] = ...,
        independent_marker_orientation: bool = ...,
        description: str = ...,
    ) -> None: ...

class InteractiveMarkerFeedback(Message):
    KEEP_ALIVE: Final = 0
    POSE_UPDATE: Final = 1
    MENU_SELECT: Final = 2
    BUTTON_CLICK: Final = 3
    MOUSE_DOWN: Final = 4
    MOUSE_UP: Final = 5
    header: std_msgs_msg.Header
    client_id: str
    marker_name: str
    control_name: str
    event_type: int
    pose: geometry_msgs_msg.Pose
    menu_entry_id: int
    mouse_point: geometry_msgs_msg.Point
    mouse_point_valid: bool
    def __init__(
        self,
        *,
        header: std_msgs_msg.Header = ...,
        client_id: str = ...,
        marker_name: str = ...,
        control_name: str = ...,
        event_type: int = ...,
        pose: geometry_msgs_msg.Pose = ...,
        menu_entry_id: int = ...,
        mouse_point: geometry_msgs_msg.Point = ...,
        mouse_point_valid: bool = ...,
    ) -> None: ...

class InteractiveMarkerInit(Message):
    server_id: str
    seq_num: int
    markers: list[InteractiveMarker]
    def __init__(
        self,
        *,
        server_id: str = ...,
        seq_num: int = ...,
        markers: list[InteractiveMarker] = ...,
    ) -> None: ...

class InteractiveMarkerPose(Message):
    header: std_msgs_msg.Header
    pose: geometry_msgs_msg.Pose
    name: str
    def __init__(
        self,
        *,
        header: std_msgs_msg.Header = ...,
        pose: geometry_msgs_msg.Pose = ...,
        name: str = ...,
    ) -> None: ...

class InteractiveMarkerUpdate(Message):
    KEEP_ALIVE: Final = 0
    UPDATE: Final = 1
    server_id: str
    seq_num: int
    type: int
    markers: list[InteractiveMarker]
    poses: list[InteractiveMarkerPose]
    erases: list[str]
    def __init__(
        self,
        *,
        server_id: str = ...,
        seq_num: int = ...,
        type: int = ...,
        markers: list[InteractiveMarker] = ...,
        poses: list[InteractiveMarkerPose] = ...,
        erases: list[str] = ...,
    ) -> None: ...

class Marker(Message):
    ARROW: Final = 0
    CUBE: Final = 1
    SPHERE: Final = 2
    CYLINDER: Final = 3
    LINE_STRIP: Final = 4
    LINE_LIST: Final = 5
    CUBE_LIST: Final = 6
    SPHERE_LIST: Final = 7
    POINTS: Final = 8
    TEXT_VIEW_FACING: Final = 9
    MESH_RESOURCE: Final = 10
    TRIANGLE_LIST: Final = 11
    ARROW_STRIP: Final = 12
    ADD: Final = 0
    MODIFY: Final = 0
    DELETE: Final = 2
    DELETEALL: Final = 3
    header: std_msgs_msg.Header
    ns: str
    id: int
    type: int
    action: int
    pose: geometry_msgs_msg.Pose
    scale: geometry_msgs_msg.Vector3
    color: std_msgs_msg.ColorRGBA
    lifetime: builtin_interfaces_msg.Duration
    frame_locked: bool
    points: list[geometry_msgs_msg.Point]
    colors: list[std_msgs_msg.ColorRGBA]
    texture_resource: str
    texture: sensor_msgs_msg.CompressedImage
    uv_coordinates: list[UVCoordinate]
    text: str
    mesh_resource: str
    mesh_file: MeshFile
    mesh_use_embedded_materials: bool
    def __init__(
        self,
        *,
        header: std_msgs_msg.Header = ...,
        ns: str = ...,
        id: int = ...,
        type: int = ...,
        action: int = ...,
        pose: geometry_msgs_msg.Pose = ...,
        scale: geometry_msgs_msg.Vector3 = ...,
        color: std_msgs_msg.ColorRGBA = ...,
        lifetime: builtin_interfaces_msg.Duration = ...,
        frame_locked: bool = ...,
        points: list[geometry_msgs_msg.Point] = ...,
        colors: list[std_msgs_msg.ColorRGBA] = ...,
        texture_resource: str = ...,
        texture: sensor_msgs_msg.CompressedImage = ...,
        uv_coordinates: list[UVCoordinate] = ...,
        text: str = ...,
        mesh_resource: str = ...,
        mesh_file: MeshFile = ...,
        mesh_use_embedded_materials: bool = ...,
    ) -> None: ...

class MarkerArray(Message):
    markers: list[Marker]
    def __init__(
        self,
        *,
        markers: list[Marker] = ...,
    ) -> None: ...

class MenuEntry(Message):
    FEEDBACK: Final = 0
    ROSRUN: Final = 1
    ROSLAUNCH: Final = 2
    id: int
    parent_id: int
    title: str
    command: str
    command_type: int
    def __init__(
        self,
        *,
        id: int = ...,
        parent_id: int = ...,
        title: str = ...,
        command: str = ...,
        command_type: int = ...,
    ) -> None: ...

class MeshFile(Message):
    filename: str
    data: npt.NDArray[np.uint8]
    def __init__(
        self,
        *,
        filename: str = ...,
        data: npt.NDArray[Any] | Sequence[int] | bytes | bytearray | memoryview = ...,
    ) -> None: ...

class UVCoordinate(Message):
    u: float
    v: float
    def __init__(
        self,
        *,
        u: float = ...,
        v: float = ...,
    ) -> None: ...
