"""The services of composition_interfaces."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from metaros.idl import Message, Service
from metaros.interfaces.rcl_interfaces import msg as rcl_interfaces_msg
from metaros.interfaces.service_msgs import msg as service_msgs_msg

class ListNodes_Request(Message): ...

class ListNodes_Response(Message):
    full_node_names: list[str]
    unique_ids: npt.NDArray[np.uint64]
    def __init__(
        self,
        *,
        full_node_names: list[str] = ...,
        unique_ids: npt.NDArray[Any] | Sequence[int] = ...,
    ) -> None: ...

class ListNodes_Event(Message):
    info: service_msgs_msg.ServiceEventInfo
    request: list[ListNodes_Request]
    response: list[ListNodes_Response]
    def __init__(
        self,
        *,
        info: service_msgs_msg.ServiceEventInfo = ...,
        request: list[ListNodes_Request] = ...,
        response: list[ListNodes_Response] = ...,
    ) -> None: ...

class ListNodes(Service):
    Request = ListNodes_Request
    Response = ListNodes_Response
    Event = ListNodes_Event

class LoadNode_Request(Message):
    package_name: str
    plugin_name: str
    node_name: str
    node_namespace: str
    log_level: int
    remap_rules: list[str]
    parameters: list[rcl_interfaces_msg.Parameter]
    extra_arguments: list[rcl_interfaces_msg.Parameter]
    def __init__(
        self,
        *,
        package_name: str = ...,
        plugin_name: str = ...,
        node_name: str = ...,
        node_namespace: str = ...,
        log_level: int = ...,
        remap_rules: list[str] = ...,
        parameters: list[rcl_interfaces_msg.Parameter] = ...,
        extra_arguments: list[rcl_interfaces_msg.Parameter] = ...,
    ) -> None: ...

class LoadNode_Response(Message):
    success: bool
    error_message: str
    full_node_name: str
    unique_id: int
    def __init__(
        self,
        *,
        success: bool = ...,
        error_message: str = ...,
        full_node_name: str = ...,
        unique_id: int = ...,
    ) -> None: ...

class LoadNode_Event(Message):
    info: service_msgs_msg.ServiceEventInfo
    request: list[LoadNode_Request]
    response: list[LoadNode_Response]
    def __init__(
        self,
        *,
        info: service_msgs_msg.ServiceEventInfo = ...,
        request: list[LoadNode_Request] = ...,
        response: list[LoadNode_Response] = ...,
    ) -> None: ...

class LoadNode(Service):
    Request = LoadNode_Request
    Response = LoadNode_Response
    Event = LoadNode_Event

class UnloadNode_Request(Message):
    unique_id: int
    def __init__(
        self,
        *,
        unique_id: int = ...,
    ) -> None: ...

class UnloadNode_Response(Message):
    success: bool
    error_message: str
    def __init__(
        self,
        *,
        success: bool = ...,
        error_message: str = ...,
    ) -> None: ...

class UnloadNode_Event(Message):
    info: service_msgs_msg.ServiceEventInfo
    request: list[UnloadNode_Request]
    response: list[UnloadNode_Response]
    def __init__(
        self,
        *,
        info: service_msgs_msg.ServiceEventInfo = ...,
        request: list[UnloadNode_Request] = ...,
        response: list[UnloadNode_Response] = ...,
    ) -> None: ...

class UnloadNode(Service):
    Request = UnloadNode_Request
    Response = UnloadNode_Response
    Event = UnloadNode_Event
