"""The messages of tf2_msgs."""

from typing import Final

from metaros.idl import Message
from metaros.interfaces.geometry_msgs import msg as geometry_msgs_msg

class TF2Error(Message):
    NO_ERROR: Final = 0
    LOOKUP_ERROR: Final = 1
    CONNECTIVITY_ERROR: Final = 2
    EXTRAPOLATION_ERROR: Final = 3
    INVALID_ARGUMENT_ERROR: Final = 4
    TIMEOUT_ERROR: Final = 5
    TRANSFORM_ERROR: Final = 6
    error: int
    error_string: str
    def __init__(
        self,
        *,
        error: int = ...,
        error_string: str = ...,
    ) -> None: ...

class TFMessage(Message):
    transforms: list[geometry_msgs_msg.TransformStamped]
    def __init__(
        self,
        *,
        transforms: list[geometry_msgs_msg.TransformStamped] = ...,
    ) -> None: ...
