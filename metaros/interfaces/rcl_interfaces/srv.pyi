"""The services of rcl_interfaces."""

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from metaros.idl import Message, Service
from metaros.interfaces.rcl_interfaces import msg as rcl_interfaces_msg
from metaros.interfaces.service_msgs import msg as service_msgs_msg

class DescribeParameters_Request(Message):
    names: list[str]
    def __init__(
        self,
        *,
        names: list[str] = ...,
    ) -> None: ...

class DescribeParameters_Response(Message):
    descriptors: list[rcl_interfaces_msg.ParameterDescriptor]
    def __init__(
        self,
        *,
        descriptors: list[rcl_interfaces_msg.ParameterDescriptor] = ...,
    ) -> None: ...

class DescribeParameters_Event(Message):
    info: service_msgs_msg.ServiceEventInfo
    request: list[DescribeParameters_Request]
    response: list[DescribeParameters_Response]
    def __init__(
        self,
        *,
        info: service_msgs_msg.ServiceEventInfo = ...,
        request: list[DescribeParameters_Request] = ...,
        response: list[DescribeParameters_Response] = ...,
    ) -> None: ...

class DescribeParameters(Service):
    Request = DescribeParameters_Request
    Response = DescribeParameters_Response
    Event = DescribeParameters_Event

class GetLoggerLevels_Request(Message):
    names: list[str]
    def __init__(
        self,
        *,
        names: list[str] = ...,
    ) -> None: ...

class GetLoggerLevels_Response(Message):
    levels: list[rcl_interfaces_msg.LoggerLevel]
    def __init__(
        self,
        *,
        levels: list[rcl_interfaces_msg.LoggerLevel] = ...,
    ) -> None: ...

class GetLoggerLevels_Event(Message):
    info: service_msgs_msg.ServiceEventInfo
    request: list[GetLoggerLevels_Request]
    response: list[GetLoggerLevels_Response]
    def __init__(
        self,
        *,
        info: service_msgs_msg.ServiceEventInfo = ...,
        request: list[GetLoggerLevels_Request] = ...,
        response: list[GetLoggerLevels_Response] = ...,
    ) -> None: ...

class GetLoggerLevels(Service):
    Request = GetLoggerLevels_Request
    Response = GetLoggerLevels_Response
    Event = GetLoggerLevels_Event

class GetParameterTypes_Request(Message):
    names: list[str]
    def __init__(
        self,
        *,
        names: list[str] = ...,
    ) -> None: ...

class GetParameterTypes_Response(Message):
    types: npt.NDArray[np.uint8]
    def __init__(
        self,
        *,
        types: npt.NDArray[Any] | Sequence[int] | bytes | bytearray | memoryview = ...,
    ) -> None: ...

class GetParameterTypes_Event(Message):
    info: service_msgs_msg.ServiceEventInfo
    request: list[GetParameterTypes_Request]
    response: list[GetParameterTypes_Response]
    def __init__(
        self,
        *,
        info: service_msgs_msg.ServiceEventInfo = ...,
        request: list[GetParameterTypes_Request] = ...,
        response: list[GetParameterTypes_Response] = ...,
    ) -> None: ...

class GetParameterTypes(Service):
    Request = GetParameterTypes_Request
    Response = GetParameterTypes_Response
    Event = GetParameterTypes_Event

class GetParameters_Request(Message):
    names: list[str]
    def __init__(
        self,
        *,
        names: list[str] = ...,
    ) -> None: ...

class GetParameters_Response(Message):
    values: list[rcl_interfaces_msg.ParameterValue]
    def __init__(
        self,
        *,
        values: list[rcl_interfaces_msg.ParameterValue] = ...,
    ) -> None: ...

class GetParameters_Event(Message):
    info: service_msgs_msg.ServiceEventInfo
    request: list[GetParameters_Request]
    response: list[GetParameters_Response]
    def __init__(
        self,
        *,
        info: service_msgs_msg.ServiceEventInfo = ...,
        request: list[GetParameters_Request] = ...,
        response: list[GetParameters_Response] = ...,
    ) -> None: ...

class GetParameters(Service):
    Request = GetParameters_Request
    Response = GetParameters_Response
    Event = GetParameters_Event

class ListParameters_Request(Message):
    DEPTH_RECURSIVE: Final = 0
    prefixes: list[str]
    depth: int
    def __init__(
        self,
        *,
        prefixes: list[str] = ...,
        depth: int = ...,
    ) -> None: ...

class ListParameters_Response(Message):
    result: rcl_interfaces_msg.ListParametersResult
    def __init__(
        self,
        *,
        result: rcl_interfaces_msg.ListParametersResult = ...,
    ) -> None: ...

class ListParameters_Event(Message):
    info: service_msgs_msg.ServiceEventInfo
    request: list[ListParameters_Request]
    response: list[ListParameters_Response]
    def __init__(
        self,
        *,
        info: service_msgs_msg.ServiceEventInfo = ...,
        request: list[ListParameters_Request] = ...,
        response: list[ListParameters_Response] = ...,
    ) -> None: ...

class ListParameters(Service):
    Request = ListParameters_Request
    Response = ListParameters_Response
    Event = ListParameters_Event

class SetLoggerLevels_Request(Message):
    levels: list[rcl_interfaces_msg.LoggerLevel]
    def __init__(
        self,
        *,
        levels: list[rcl_interfaces_msg.LoggerLevel] = ...,
    ) -> None: ...

class SetLoggerLevels_Response(Message):
    results: list[rcl_interfaces_msg.SetLoggerLevelsResult]
    def __init__(
        self,
        *,
        results: list[rcl_interfaces_msg.SetLoggerLevelsResult] = ...,
    ) -> None: ...

class SetLoggerLevels_Event(Message):
    info: service_msgs_msg.ServiceEventInfo
    request: list[SetLoggerLevels_Request]
    response: list[SetLoggerLevels_Response]
    def __init__(
        self,
        *,
        info: service_msgs_msg.ServiceEventInfo = ...,
        request: list[SetLoggerLevels_Request] = ...,
        response: list[SetLoggerLevels_Response] = ...,
    ) -> None: ...

class SetLoggerLevels(Service):
    Request = SetLoggerLevels_Request
    Response = SetLoggerLevels_Response
    Event = SetLoggerLevels_Event

class SetParameters_Request(Message):
    parameters: list[rcl_interfaces_msg.Parameter]
    def __init__(
        self,
        *,
        parameters: list[rcl_interfaces_msg.Parameter] = ...,
    ) -> None: ...

class SetParameters_Response(Message):
    results: list[rcl_interfaces_msg.SetParametersResult]
    def __init__(
        self,
        *,
        results: list[rcl_interfaces_msg.SetParametersResult] = ...,
    ) -> None: ...

class SetParameters_Event(Message):
    info: service_msgs_msg.ServiceEventInfo
    request: list[SetParameters_Request]
    response: list[SetParameters_Response]
    def __init__(
        self,
        *,
        info: service_msgs_msg.ServiceEventInfo = ...,
        request: list[SetParameters_Request] = ...,
        response: list[SetParameters_Response] = ...,
    ) -> None: ...

class SetParameters(Service):
    Request = SetParameters_Request
    Response = SetParameters_Response
    Event = SetParameters_Event

class SetParametersAtomically_Request(Message):
    parameters: list[rcl_interfaces_msg.Parameter]
    def __init__(
        self,
        *,
        parameters: list[rcl_interfaces_msg.Parameter] = ...,
    ) -> None: ...

class SetParametersAtomically_Response(Message):
    result: rcl_interfaces_msg.SetParametersResult
    def __init__(
        self,
        *,
        result: rcl_interfaces_msg.SetParametersResult = ...,
    ) -> None: ...

class SetParametersAtomically_Event(Message):
    info: service_msgs_msg.ServiceEventInfo
    request: list[SetParametersAtomically_Request]
    response: list[SetParametersAtomically_Response]
    def __init__(
        self,
        *,
        info: service_msgs_msg.ServiceEventInfo = ...,
        request: list[SetParametersAtomically_Request] = ...,
        response: list[SetParametersAtomically_Response] = ...,
    ) -> None: ...

class SetParametersAtomically(Service):
    Request = SetParametersAtomically_Request
    Response = SetParametersAtomically_Response
    Event = SetParametersAtomically_Event
