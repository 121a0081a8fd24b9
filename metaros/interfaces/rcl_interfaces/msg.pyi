# ruff: noqa: A002
"""The messages of rcl_interfaces."""

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from metaros.idl import Message
from metaros.interfaces.builtin_interfaces import msg as builtin_interfaces_msg

class FloatingPointRange(Message):
    from_value: float
    to_value: float
    step: float
    def __init__(
        self,
        *,
        from_value: float = ...,
        to_value: float = ...,
        step: float = ...,
    ) -> None: ...

class IntegerRange(Message):
    from_value: int
    to_value: int
    step: int
    def __init__(
        self,
        *,
        from_value: int = ...,
        to_value: int = ...,
        step: int = ...,
    ) -> None: ...

class ListParametersResult(Message):
    names: list[str]
    prefixes: list[str]
    def __init__(
        self,
        *,
        names: list[str] = ...,
        prefixes: list[str] = ...,
    ) -> None: ...

class Log(Message):
    DEBUG: Final = 10
    INFO: Final = 20
    WARN: Final = 30
    ERROR: Final = 40
    FATAL: Final = 50
    stamp: builtin_interfaces_msg.Time
    level: int
    name: str
    msg: str
    file: str
    function: str
    line: int
    def __init__(
        self,
        *,
        stamp: builtin_interfaces_msg.Time = ...,
        level: int = ...,
        name: str = ...,
        msg: str = ...,
        file: str = ...,
        function: str = ...,
        line: int = ...,
    ) -> None: ...

class LoggerLevel(Message):
    LOG_LEVEL_UNKNOWN: Final = 0
    LOG_LEVEL_DEBUG: Final = 10
    LOG_LEVEL_INFO: Final = 20
    LOG_LEVEL_WARN: Final = 30
    LOG_LEVEL_ERROR: Final = 40
    LOG_LEVEL_FATAL: Final = 50
    name: str
    level: int
    def __init__(
        self,
        *,
        name: str = ...,
        level: int = ...,
    ) -> None: ...

class Parameter(Message):
    name: str
    value: ParameterValue
    def __init__(
        self,
        *,
        name: str = ...,
        value: ParameterValue = ...,
    ) -> None: ...

class ParameterDescriptor(Message):
    name: str
    type: int
    description: str
    additional_constraints: str
    read_only: bool
    dynamic_typing: bool
    floating_point_range: list[FloatingPointRange]
    integer_range: list[IntegerRange]
    def __init__(
        self,
        *,
        name: str = ...,
        type: int = ...,
        description: str = ...,
        additional_constraints: str = ...,
        read_only: bool = ...,
        dynamic_typing: bool = ...,
        floating_point_range: list[FloatingPointRange] = ...,
        integer_range: list[IntegerRange] = ...,
    ) -> None: ...

class ParameterEvent(Message):
    stamp: builtin_interfaces_msg.Time
    node: str
    new_parameters: list[Parameter]
    changed_parameters: list[Parameter]
    deleted_parameters: list[Parameter]
    def __init__(
        self,
        *,
        stamp: builtin_interfaces_msg.Time = ...,
        node: str = ...,
        new_parameters: list[Parameter] = ...,
        changed_parameters: list[Parameter] = ...,
        deleted_parameters: list[Parameter] = ...,
    ) -> None: ...

class ParameterEventDescriptors(Message):
    new_parameters: list[ParameterDescriptor]
    changed_parameters: list[ParameterDescriptor]
    deleted_parameters: list[ParameterDescriptor]
    def __init__(
        self,
        *,
        new_parameters: list[ParameterDescriptor] = ...,
        changed_parameters: list[ParameterDescriptor] = ...,
        deleted_parameters: list[ParameterDescriptor] = ...,
    ) -> None: ...

class ParameterType(Message):
    PARAMETER_NOT_SET: Final = 0
    PARAMETER_BOOL: Final = 1
    PARAMETER_INTEGER: Final = 2
    PARAMETER_DOUBLE: Final = 3
    PARAMETER_STRING: Final = 4
    PARAMETER_BYTE_ARRAY: Final = 5
    PARAMETER_BOOL_ARRAY: Final = 6
    PARAMETER_INTEGER_ARRAY: Final = 7
    PARAMETER_DOUBLE_ARRAY: Final = 8
    PARAMETER_STRING_ARRAY: Final = 9

class ParameterValue(Message):
    type: int
    bool_value: bool
    integer_value: int
    double_value: float
    string_value: str
    byte_array_value: npt.NDArray[np.uint8]
    bool_array_value: npt.NDArray[np.bool_]
    integer_array_value: npt.NDArray[np.int64]
    double_array_value: npt.NDArray[np.float64]
    string_array_value: list[str]
    def __init__(
        self,
        *,
        type: int = ...,
        bool_value: bool = ...,
        integer_value: int = ...,
        double_value: float = ...,
        string_value: str = ...,
        byte_array_value: npt.NDArray[Any] | Sequence[int] | bytes | bytearray | memoryview = ...,
        bool_array_value: npt.NDArray[Any] | Sequence[bool] | bytes | bytearray | memoryview = ...,
        integer_array_value: npt.NDArray[Any] | Sequence[int] = ...,
        double_array_value: npt.NDArray[Any] | Sequence[float] = ...,
        string_array_value: list[str] = ...,
    ) -> None: ...

class SetLoggerLevelsResult(Message):
    successful: bool
    reason: str
    def __init__(
        self,
        *,
        successful: bool = ...,
        reason: str = ...,
    ) -> None: ...

class SetParametersResult(Message):
    successful: bool
    reason: str
    def __init__(
        self,
        *,
        successful: bool = ...,
        reason: str = ...,
    ) -> None: ...
