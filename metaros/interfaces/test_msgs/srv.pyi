"""The services of test_msgs."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from metaros.idl import Message, Service
from metaros.interfaces.service_msgs import msg as service_msgs_msg
from metaros.interfaces.test_msgs import msg as test_msgs_msg

class Arrays_Request(Message):
    bool_values: npt.NDArray[np.bool_]
    byte_values: npt.NDArray[np.uint8]
    char_values: npt.NDArray[np.uint8]
    float32_values: npt.NDArray[np.float32]
    float64_values: npt.NDArray[np.float64]
    int8_values: npt.NDArray[np.int8]
    uint8_values: npt.NDArray[np.uint8]
    int16_values: npt.NDArray[np.int16]
    uint16_values: npt.NDArray[np.uint16]
    int32_values: npt.NDArray[np.int32]
    uint32_values: npt.NDArray[np.uint32]
    int64_values: npt.NDArray[np.int64]
    uint64_values: npt.NDArray[np.uint64]
    string_values: list[str]
    basic_types_values: list[test_msgs_msg.BasicTypes]
    constants_values: list[test_msgs_msg.Constants]
    defaults_values: list[test_msgs_msg.Defaults]
    bool_values_default: npt.NDArray[np.bool_]
    byte_values_default: npt.NDArray[np.uint8]
    char_values_default: npt.NDArray[np.uint8]
    float32_values_default: npt.NDArray[np.float32]
    float64_values_default: npt.NDArray[np.float64]
    int8_values_default: npt.NDArray[np.int8]
    uint8_values_default: npt.NDArray[np.uint8]
    int16_values_default: npt.NDArray[np.int16]
    uint16_values_default: npt.NDArray[np.uint16]
    int32_values_default: npt.NDArray[np.int32]
    uint32_values_default: npt.NDArray[np.uint32]
    int64_values_default: npt.NDArray[np.int64]
    uint64_values_default: npt.NDArray[np.uint64]
    string_values_default: list[str]
    def __init__(
        self,
        *,
        bool_values: npt.NDArray[Any] | Sequence[bool] | bytes | bytearray | memoryview = ...,
        byte_values: npt.NDArray[Any] | Sequence[int] | bytes | bytearray | memoryview = ...,
        char_values: npt.NDArray[Any] | Sequence[int] | bytes | bytearray | memoryview = ...,
        float32_values: npt.NDArray[Any] | Sequence[float] = ...,
        float64_values: npt.NDArray[Any] | Sequence[float] = ...,
        int8_values: npt.NDArray[Any] | Sequence[int] | bytes | bytearray | memoryview = ...,
        uint8_values: npt.NDArray[Any] | Sequence[int] | bytes | bytearray | memoryview = ...,
        int16_values: npt.NDArray[Any] | Sequence[int] = ...,
        uint16_values: npt.NDArray[Any] | Sequence[int] = ...,
        int32_values: npt.NDArray[Any] | Sequence[int] = ...,
        uint32_values: npt.NDArray[Any] | Sequence[int] = ...,
        int64_values: npt.NDArray[Any] | Sequence[int] = ...,
        uint64_values: npt.NDArray[Any] | Sequence[int] = ...,
        string_values: list[str] = ...,
        basic_types_values: list[test_msgs_msg.BasicTypes] = ...,
        constants_values: list[test_msgs_msg.Constants] = ...,
        defaults_values: list[test_msgs_msg.Defaults] = ...,
        bool_values_default: npt.NDArray[Any] | Sequence[bool] | bytes | bytearray | memoryview = ...,
        byte_values_default: npt.NDArray[Any] | Sequence[int] | bytes | bytearray | memoryview = ...,
        char_values_default: npt.NDArray[Any] | Sequence[int] | bytes | bytearray | memoryview = ...,
        float32_values_default: npt.NDArray[Any] | Sequence[float] = ...,
        float64_values_default: npt.NDArray[Any] | Sequence[float] = ...,
        int8_values_default: npt.NDArray[Any] | Sequence[int] | bytes | bytearray | memoryview = ...,
        uint8_values_default: npt.NDArray[Any] | Sequence[int] | bytes | bytearray | memoryview = ...,
        int16_values_default: npt.NDArray[Any] | Sequence[int] = ...,
        uint16_values_default: npt.NDArray[Any] | Sequence[int] = ...,
        int32_values_default: npt.NDArray[Any] | Sequence[int] = ...,
        uint32_values_default: npt.NDArray[Any] | Sequence[int] = ...,
        int64_values_default: npt.NDArray[Any] | Sequence[int] = ...,
        uint64_values_default: npt.NDArray[Any] | Sequence[int] = ...,
        string_values_default: list[str] = ...,
    ) -> None: ...

class Arrays_Response(Message):
    bool_values: npt.NDArray[np.bool_]
    byte_values: npt.NDArray[np.uint8]
    char_values: npt.NDArray[np.uint8]
    float32_values: npt.NDArray[np.float32]
    float64_values: npt.NDArray[np.float64]
    int8_values: npt.NDArray[np.int8]
    uint8_values: npt.NDArray[np.uint8]
    int16_values: npt.NDArray[np.int16]
    uint16_values: npt.NDArray[np.uint16]
    int32_values: npt.NDArray[np.int32]
    uint32_values: npt.NDArray[np.uint32]
    int64_values: npt.NDArray[np.int64]
    uint64_values: npt.NDArray[np.uint64]
    string_values: list[str]
    basic_types_values: list[test_msgs_msg.BasicTypes]
    constants_values: list[test_msgs_msg.Constants]
    defaults_values: list[test_msgs_msg.Defaults]
    bool_values_default: npt.NDArray[np.bool_]
    byte_values_default: npt.NDArray[np.uint8]
    char_values_default: npt.NDArray[np.uint8]
    float32_values_default: npt.NDArray[np.float32]
    float64_values_default: npt.NDArray[np.float64]
    int8_values_default: npt.NDArray[np.int8]
    uint8_values_default: npt.NDArray[np.uint8]
    int16_values_default: npt.NDArray[np.int16]
    uint16_values_default: npt.NDArray[np.uint16]
    int32_values_default: npt.NDArray[np.int32]
    uint32_values_default: npt.NDArray[np.uint32]
    int64_values_default: npt.NDArray[np.int64]
    uint64_values_default: npt.NDArray[np.uint64]
    string_values_default: list[str]
    def __init__(
        self,
        *,
        bool_values: npt.NDArray[Any] | Sequence[bool] | bytes | bytearray | memoryview = ...,
        byte_values: npt.NDArray[Any] | Sequence[int] | bytes | bytearray | memoryview = ...,
        char_values: npt.NDArray[Any] | Sequence[int] | bytes | bytearray | memoryview = ...,
        float32_values: npt.NDArray[Any] | Sequence[float] = ...,
        float64_values: npt.NDArray[Any] | Sequence[float] = ...,
        int8_values: npt.NDArray[Any] | Sequence[int] | bytes | bytearray | memoryview = ...,
        uint8_values: npt.NDArray[Any] | Sequence[int] | bytes | bytearray | memoryview = ...,
        int16_values: npt.NDArray[Any] | Sequence[int] = ...,
        uint16_values: npt.NDArray[Any] | Sequence[int] = ...,
        int32_values: npt.NDArray[Any] | Sequence[int] = ...,
        uint32_values: npt.NDArray[Any] | Sequence[int] = ...,
        int64_values: npt.NDArray[Any] | Sequence[int] = ...,
        uint64_values: npt.NDArray[Any] | Sequence[int] = ...,
        string_values: list[str] = ...,
        basic_types_values: list[test_msgs_msg.BasicTypes] = ...,
        constants_values: list[test_msgs_msg.Constants] = ...,
        defaults_values: list[test_msgs_msg.Defaults] = ...,
        bool_values_default: npt.NDArray[Any] | Sequence[bool] | bytes | bytearray | memoryview = ...,
        byte_values_default: npt.NDArray[Any] | Sequence[int] | bytes | bytearray | memoryview = ...,
        char_values_default: npt.NDArray[Any] | Sequence[int] | bytes | bytearray | memoryview = ...,
        float32_values_default: npt.NDArray[Any] | Sequence[float] = ...,
        float64_values_default: npt.NDArray[Any] | Sequence[float] = ...,
        int8_values_default: npt.NDArray[Any] | Sequence[int] | bytes | bytearray | memoryview = ...,
        uint8_values_default: npt.NDArray[Any] | Sequence[int] | bytes | bytearray | memoryview = ...,
        int16_values_default: npt.NDArray[Any] | Sequence[int] = ...,
        uint16_values_default: npt.NDArray[Any] | Sequence[int] = ...,
        int32_values_default: npt.NDArray[Any] | Sequence[int] = ...,
        uint32_values_default: npt.NDArray[Any] | Sequence[int] = ...,
        int64_values_default: npt.NDArray[Any] | Sequence[int] = ...,
        uint64_values_default: npt.NDArray[Any] | Sequence[int] = ...,
        string_values_default: list[str] = ...,
    ) -> None: ...

class Arrays_Event(Message):
    info: service_msgs_msg.ServiceEventInfo
    request: list[Arrays_Request]
    response: list[Arrays_Response]
    def __init__(
        self,
        *,
        info: service_msgs_msg.ServiceEventInfo = ...,
        request: list[Arrays_Request] = ...,
        response: list[Arrays_Response] = ...,
    ) -> None: ...

class Arrays(Service):
    Request = Arrays_Request
    Response = Arrays_Response
    Event = Arrays_Event

class BasicTypes_Request(Message):
    bool_value: bool
    byte_value: int
    char_value: int
    float32_value: float
    float64_value: float
    int8_value: int
    uint8_value: int
    int16_value: int
    uint16_value: int
    int32_value: int
    uint32_value: int
    int64_value: int
    uint64_value: int
    string_value: str
    def __init__(
        self,
        *,
        bool_value: bool = ...,
        byte_value: int = ...,
        char_value: int = ...,
        float32_value: float = ...,
        float64_value: float = ...,
        int8_value: int = ...,
        uint8_value: int = ...,
        int16_value: int = ...,
        uint16_value: int = ...,
        int32_value: int = ...,
        uint32_value: int = ...,
        int64_value: int = ...,
        uint64_value: int = ...,
        string_value: str = ...,
    ) -> None: ...

class BasicTypes_Response(Message):
    bool_value: bool
    byte_value: int
    char_value: int
    float32_value: float
    float64_value: float
    int8_value: int
    uint8_value: int
    int16_value: int
    uint16_value: int
    int32_value: int
    uint32_value: int
    int64_value: int
    uint64_value: int
    string_value: str
    def __init__(
        self,
        *,
        bool_value: bool = ...,
        byte_value: int = ...,
        char_value: int = ...,
        float32_value: float = ...,
        float64_value: float = ...,
        int8_value: int = ...,
        uint8_value: int = ...,
        int16_value: int = ...,
        uint16_value: int = ...,
        int32_value: int = ...,
        uint32_value: int = ...,
        int64_value: int = ...,
        uint64_value: int = ...,
        string_value: str = ...,
    ) -> None: ...

class BasicTypes_Event(Message):
    info: service_msgs_msg.ServiceEventInfo
    request: list[BasicTypes_Request]
    response: list[BasicTypes_Response]
    def __init__(
        self,
        *,
        info: service_msgs_msg.ServiceEventInfo = ...,
        request: list[BasicTypes_Request] = ...,
        response: list[BasicTypes_Response] = ...,
    ) -> None: ...

class BasicTypes(Service):
    Request = BasicTypes_Request
    Response = BasicTypes_Response
    Event = BasicTypes_Event

class Empty_Request(Message): ...
class Empty_Response(Message): ...

class Empty_Event(Message):
    info: service_msgs_msg.ServiceEventInfo
    request: list[Empty_Request]
    response: list[Empty_Response]
    def __init__(
        self,
        *,
        info: service_msgs_msg.ServiceEventInfo = ...,
        request: list[Empty_Request] = ...,
        response: list[Empty_Response] = ...,
    ) -> None: ...

class Empty(Service):
    Request = Empty_Request
    Response = Empty_Response
    Event = Empty_Event
