"""The messages of example_interfaces."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from metaros.idl import Message

class Bool(Message):
    data: bool
    def __init__(
        self,
        *,
        data: bool = ...,
    ) -> None: ...

class Byte(Message):
    data: int
    def __init__(
        self,
        *,
        data: int = ...,
    ) -> None: ...

class ByteMultiArray(Message):
    layout: MultiArrayLayout
    data: npt.NDArray[np.uint8]
    def __init__(
        self,
        *,
        layout: MultiArrayLayout = ...,
        data: npt.NDArray[Any] | Sequence[int] | bytes | bytearray | memoryview = ...,
    ) -> None: ...

class Char(Message):
    data: int
    def __init__(
        self,
        *,
        data: int = ...,
    ) -> None: ...

class Empty(Message): ...

class Float32(Message):
    data: float
    def __init__(
        self,
        *,
        data: float = ...,
    ) -> None: ...

class Float32MultiArray(Message):
    layout: MultiArrayLayout
    data: npt.NDArray[np.float32]
    def __init__(
        self,
        *,
        layout: MultiArrayLayout = ...,
        data: npt.NDArray[Any] | Sequence[float] = ...,
    ) -> None: ...

class Float64(Message):
    data: float
    def __init__(
        self,
        *,
        data: float = ...,
    ) -> None: ...

class Float64MultiArray(Message):
    layout: MultiArrayLayout
    data: npt.NDArray[np.float64]
    def __init__(
        self,
        *,
        layout: MultiArrayLayout = ...,
        data: npt.NDArray[Any] | Sequence[float] = ...,
    ) -> None: ...

class Int16(Message):
    data: int
    def __init__(
        self,
        *,
        data: int = ...,
    ) -> None: ...

class Int16MultiArray(Message):
    layout: MultiArrayLayout
    data: npt.NDArray[np.int16]
    def __init__(
        self,
        *,
        layout: MultiArrayLayout = ...,
        data: npt.NDArray[Any] | Sequence[int] = ...,
    ) -> None: ...

class Int32(Message):
    data: int
    def __init__(
        self,
        *,
        data: int = ...,
    ) -> None: ...

class Int32MultiArray(Message):
    layout: MultiArrayLayout
    data: npt.NDArray[np.int32]
    def __init__(
        self,
        *,
        layout: MultiArrayLayout = ...,
        data: npt.NDArray[Any] | Sequence[int] = ...,
    ) -> None: ...

class Int64(Message):
    data: int
    def __init__(
        self,
        *,
        data: int = ...,
    ) -> None: ...

class Int64MultiArray(Message):
    layout: MultiArrayLayout
    data: npt.NDArray[np.int64]
    def __init__(
        self,
        *,
        layout: MultiArrayLayout = ...,
        data: npt.NDArray[Any] | Sequence[int] = ...,
    ) -> None: ...

class Int8(Message):
    data: int
    def __init__(
        self,
        *,
        data: int = ...,
    ) -> None: ...

class Int8MultiArray(Message):
    layout: MultiArrayLayout
    data: npt.NDArray[np.int8]
    def __init__(
        self,
        *,
        layout: MultiArrayLayout = ...,
        data: npt.NDArray[Any] | Sequence[int] | bytes | bytearray | memoryview = ...,
    ) -> None: ...

class MultiArrayDimension(Message):
    label: str
    size: int
    stride: int
    def __init__(
        self,
        *,
        label: str = ...,
        size: int = ...,
        stride: int = ...,
    ) -> None: ...

class MultiArrayLayout(Message):
    dim: list[MultiArrayDimension]
    data_offset: int
    def __init__(
        self,
        *,
        dim: list[MultiArrayDimension] = ...,
        data_offset: int = ...,
    ) -> None: ...

class String(Message):
    data: str
    def __init__(
        self,
        *,
        data: str = ...,
    ) -> None: ...

class UInt16(Message):
    data: int
    def __init__(
        self,
        *,
        data: int = ...,
    ) -> None: ...

class UInt16MultiArray(Message):
    layout: MultiArrayLayout
    data: npt.NDArray[np.uint16]
    def __init__(
        self,
        *,
        layout: MultiArrayLayout = ...,
        data: npt.NDArray[Any] | Sequence[int] = ...,
    ) -> None: ...

class UInt32(Message):
    data: int
    def __init__(
        self,
        *,
        data: int = ...,
    ) -> None: ...

class UInt32MultiArray(Message):
    layout: MultiArrayLayout
    data: npt.NDArray[np.uint32]
    def __init__(
        self,
        *,
        layout: MultiArrayLayout = ...,
        data: npt.NDArray[Any] | Sequence[int] = ...,
    ) -> None: ...

class UInt64(Message):
    data: int
    def __init__(
        self,
        *,
        data: int = ...,
    ) -> None: ...

class UInt64MultiArray(Message):
    layout: MultiArrayLayout
    data: npt.NDArray[np.uint64]
    def __init__(
        self,
        *,
        layout: MultiArrayLayout = ...,
        data: npt.NDArray[Any] | Sequence[int] = ...,
    ) -> None: ...

class UInt8(Message):
    data: int
    def __init__(
        self,
        *,
        data: int = ...,
    ) -> None: ...

class UInt8MultiArray(Message):
    layout: MultiArrayLayout
    data: npt.NDArray[np.uint8]
    def __init__(
        self,
        *,
        layout: MultiArrayLayout = ...,
        data: npt.NDArray[Any] | Sequence[int] | bytes | bytearray | memoryview = ...,
    ) -> None: ...

class WString(Message):
    data: str
    def __init__(
        self,
        *,
        data: str = ...,
    ) -> None: ...
