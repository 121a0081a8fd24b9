"""The messages of test_msgs."""

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from metaros.idl import Message
from metaros.interfaces.builtin_interfaces import msg as builtin_interfaces_msg

class Arrays(Message):
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
    basic_types_values: list[BasicTypes]
    constants_values: list[Constants]
    defaults_values: list[Defaults]
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
    alignment_check: int
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
        basic_types_values: list[BasicTypes] = ...,
        constants_values: list[Constants] = ...,
        defaults_values: list[Defaults] = ...,
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
        alignment_check: int = ...,
    ) -> None: ...

class BasicTypes(Message):
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
    ) -> None: ...

class BoundedPlainSequences(Message):
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
    basic_types_values: list[BasicTypes]
    constants_values: list[Constants]
    defaults_values: list[Defaults]
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
    alignment_check: int
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
        basic_types_values: list[BasicTypes] = ...,
        constants_values: list[Constants] = ...,
        defaults_values: list[Defaults] = ...,
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
        alignment_check: int = ...,
    ) -> None: ...

class BoundedSequences(Message):
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
    basic_types_values: list[BasicTypes]
    constants_values: list[Constants]
    defaults_values: list[Defaults]
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
    alignment_check: int
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
        basic_types_values: list[BasicTypes] = ...,
        constants_values: list[Constants] = ...,
        defaults_values: list[Defaults] = ...,
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
        alignment_check: int = ...,
    ) -> None: ...

class Builtins(Message):
    duration_value: builtin_interfaces_msg.Duration
    time_value: builtin_interfaces_msg.Time
    def __init__(
        self,
        *,
        duration_value: builtin_interfaces_msg.Duration = ...,
        time_value: builtin_interfaces_msg.Time = ...,
    ) -> None: ...

class Constants(Message):
    BOOL_CONST: Final = True
    BYTE_CONST: Final = 50
    CHAR_CONST: Final = 100
    FLOAT32_CONST: Final = 1.125
    FLOAT64_CONST: Final = 1.125
    INT8_CONST: Final = -50
    UINT8_CONST: Final = 200
    INT16_CONST: Final = -1000
    UINT16_CONST: Final = 2000
    INT32_CONST: Final = -30000
    UINT32_CONST: Final = 60000
    INT64_CONST: Final = -40000000
    UINT64_CONST: Final = 50000000

class Defaults(Message):
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
    ) -> None: ...

class Empty(Message): ...

class MultiNested(Message):
    array_of_arrays: list[Arrays]
    array_of_bounded_sequences: list[BoundedSequences]
    array_of_unbounded_sequences: list[UnboundedSequences]
    bounded_sequence_of_arrays: list[Arrays]
    bounded_sequence_of_bounded_sequences: list[BoundedSequences]
    bounded_sequence_of_unbounded_sequences: list[UnboundedSequences]
    unbounded_sequence_of_arrays: list[Arrays]
    unbounded_sequence_of_bounded_sequences: list[BoundedSequences]
    unbounded_sequence_of_unbounded_sequences: list[UnboundedSequences]
    def __init__(
        self,
        *,
        array_of_arrays: list[Arrays] = ...,
        array_of_bounded_sequences: list[BoundedSequences] = ...,
        array_of_unbounded_sequences: list[UnboundedSequences] = ...,
        bounded_sequence_of_arrays: list[Arrays] = ...,
        bounded_sequence_of_bounded_sequences: list[BoundedSequences] = ...,
        bounded_sequence_of_unbounded_sequences: list[UnboundedSequences] = ...,
        unbounded_sequence_of_arrays: list[Arrays] = ...,
        unbounded_sequence_of_bounded_sequences: list[BoundedSequences] = ...,
        unbounded_sequence_of_unbounded_sequences: list[UnboundedSequences] = ...,
    ) -> None: ...

class Nested(Message):
    basic_types_value: BasicTypes
    def __init__(
        self,
        *,
        basic_types_value: BasicTypes = ...,
    ) -> None: ...

class Strings(Message):
    STRING_CONST: Final = "Hello world!"
    string_value: str
    string_value_default1: str
    string_value_default2: str
    string_value_default3: str
    string_value_default4: str
    string_value_default5: str
    bounded_string_value: str
    bounded_string_value_default1: str
    bounded_string_value_default2: str
    bounded_string_value_default3: str
    bounded_string_value_default4: str
    bounded_string_value_default5: str
    def __init__(
        self,
        *,
        string_value: str = ...,
        string_value_default1: str = ...,
        string_value_default2: str = ...,
        string_value_default3: str = ...,
        string_value_default4: str = ...,
        string_value_default5: str = ...,
        bounded_string_value: str = ...,
        bounded_string_value_default1: str = ...,
        bounded_string_value_default2: str = ...,
        bounded_string_value_default3: str = ...,
        bounded_string_value_default4: str = ...,
        bounded_string_value_default5: str = ...,
    ) -> None: ...

class UnboundedSequences(Message):
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
    basic_types_values: list[BasicTypes]
    constants_values: list[Constants]
    defaults_values: list[Defaults]
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
    alignment_check: int
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
        basic_types_values: list[BasicTypes] = ...,
        constants_values: list[Constants] = ...,
        defaults_values: list[Defaults] = ...,
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
        alignment_check: int = ...,
    ) -> None: ...

class WStrings(Message):
    wstring_value: str
    wstring_value_default1: str
    wstring_value_default2: str
    wstring_value_default3: str
    array_of_wstrings: list[str]
    bounded_sequence_of_wstrings: list[str]
    unbounded_sequence_of_wstrings: list[str]
    def __init__(
        self,
        *,
        wstring_value: str = ...,
        wstring_value_default1: str = ...,
        wstring_value_default2: str = ...,
        wstring_value_default3: str = ...,
        array_of_wstrings: list[str] = ...,
        bounded_sequence_of_wstrings: list[str] = ...,
        unbounded_sequence_of_wstrings: list[str] = ...,
    ) -> None: ...
