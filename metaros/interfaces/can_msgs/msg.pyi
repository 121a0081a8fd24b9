# ruff: noqa: A002
"""The messages of can_msgs."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from metaros.idl import Message
from metaros.interfaces.std_msgs import msg as std_msgs_msg

class Frame(Message):
    header: std_msgs_msg.Header
    id: int
    is_rtr: bool
    is_extended: bool
    is_error: bool
    dlc: int
    data: npt.NDArray[np.uint8]
    def __init__(
        self,
        *,
        header: std_msgs_msg.Header = ...,
        id: int = ...,
        is_rtr: bool = ...,
        is_extended: bool = ...,
        is_error: bool = ...,
        dlc: int = ...,
        data: npt.NDArray[Any] | Sequence[int] | bytes | bytearray | memoryview = ...,
    ) -> None: ...
