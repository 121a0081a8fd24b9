# ruff: noqa: A002
"""The services of nav_msgs."""

from typing import Final

from metaros.idl import Message, Service
from metaros.interfaces.geometry_msgs import msg as geometry_msgs_msg
from metaros.interfaces.nav_msgs import msg as nav_msgs_msg
from metaros.interfaces.service_msgs import msg as service_msgs_msg

class GetMap_Request(Message): ...

class GetMap_Response(Message):
    map: nav_msgs_msg.OccupancyGrid
    def __init__(
        self,
        *,
        map: nav_msgs_msg.OccupancyGrid = ...,
    ) -> None: ...

class GetMap_Event(Message):
    info: service_msgs_msg.ServiceEventInfo
    request: list[GetMap_Request]
    response: list[GetMap_Response]
    def __init__(
        self,
        *,
        info: service_msgs_msg.ServiceEventInfo = ...,
        request: list[GetMap_Request] = ...,
        response: list[GetMap_Response] = ...,
    ) -> None: ...

class GetMap(Service):
    Request = GetMap_Request
    Response = GetMap_Response
    Event = GetMap_Event

class GetPlan_Request(Message):
    start: geometry_msgs_msg.PoseStamped
    goal: geometry_msgs_msg.PoseStamped
    tolerance: float
    def __init__(
        self,
        *,
        start: geometry_msgs_msg.PoseStamped = ...,
        goal: geometry_msgs_msg.PoseStamped = ...,
        tolerance: float = ...,
    ) -> None: ...

class GetPlan_Response(Message):
    plan: nav_msgs_msg.Path
    def __init__(
        self,
        *,
        plan: nav_msgs_msg.Path = ...,
    ) -> None: ...

class GetPlan_Event(Message):
    info: service_msgs_msg.ServiceEventInfo
    request: list[GetPlan_Request]
    response: list[GetPlan_Response]
    def __init__(
        self,
        *,
        info: service_msgs_msg.ServiceEventInfo = ...,
        request: list[GetPlan_Request] = ...,
        response: list[GetPlan_Response] = ...,
    ) -> None: ...

class GetPlan(Service):
    Request = GetPlan_Request
    Response = GetPlan_Response
    Event = GetPlan_Event

class LoadMap_Request(Message):
    map_url: str
    def __init__(
        self,
        *,
        map_url: str = ...,
    ) -> None: ...

class LoadMap_Response(Message):
    RESULT_SUCCESS: Final = 0
    RESULT_MAP_DOES_NOT_EXIST: Final = 1
    RESULT_INVALID_MAP_DATA: Final = 2
    RESULT_INVALID_MAP_METADATA: Final = 3
    RESULT_UNDEFINED_FAILURE: Final = 255
    map: nav_msgs_msg.OccupancyGrid
    result: int
    def __init__(
        self,
        *,
        map: nav_msgs_msg.OccupancyGrid = ...,
        result: int = ...,
    ) -> None: ...

class LoadMap_Event(Message):
    info: service_msgs_msg.ServiceEventInfo
    request: list[LoadMap_Request]
    response: list[LoadMap_Response]
    def __init__(
        self,
        *,
        info: service_msgs_msg.ServiceEventInfo = ...,
        request: list[LoadMap_Request] = ...,
        response: list[LoadMap_Response] = ...,
    ) -> None: ...

class LoadMap(Service):
    Request = LoadMap_Request
    Response = LoadMap_Response
    Event = LoadMap_Event

class SetMap_Request(Message):
    map: nav_msgs_msg.OccupancyGrid
    initial_pose: geometry_msgs_msg.PoseWithCovarianceStamped
    def __init__(
        self,
        *,
        map: nav_msgs_msg.OccupancyGrid = ...,
        initial_pose: geometry_msgs_msg.PoseWithCovarianceStamped = ...,
    ) -> None: ...

class SetMap_Response(Message):
    success: bool
    def __init__(
        self,
        *,
        success: bool = ...,
    ) -> None: ...

class SetMap_Event(Message):
    info: service_msgs_msg.ServiceEventInfo
    request: list[SetMap_Request]
    response: list[SetMap_Response]
    def __init__(
        self,
        *,
        info: service_msgs_msg.ServiceEventInfo = ...,
        request: list[SetMap_Request] = ...,
        response: list[SetMap_Response] = ...,
    ) -> None: ...

class SetMap(Service):
    Request = SetMap_Request
    Response = SetMap_Response
    Event = SetMap_Event
