# ruff: noqa: A002
"""The messages of foxglove_msgs."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from metaros.idl import Message
from metaros.interfaces.builtin_interfaces import msg as builtin_interfaces_msg

class CompressedVideo(Message):
    timestamp: builtin_interfaces_msg.Time
    frame_id: str
    data: npt.NDArray[np.uint8]
    format: str
    def __init__(
        self,
        *,
        timestamp: builtin_interfaces_msg.Time = ...,
        frame_id: str = ...,
        data: npt.NDArray[Any] | Sequence[int] | bytes | bytearray | memoryview = ...,
        format: str = ...,
    ) -> None: ...

class RawAudio(Message):
    timestamp: builtin_interfaces_msg.Time
    data: npt.NDArray[np.uint8]
    format: str
    sample_rate: int
    number_of_channels: int
    def __init__(
        self,
        *,
        timestamp: builtin_interfaces_msg.Time = ...,
        data: npt.NDArray[Any] | Sequence[int] | bytes | bytearray | memoryview = ...,
        format: str = ...,
        sample_rate: int = ...,
        number_of_channels: int = ...,
    ) -> None: ...
