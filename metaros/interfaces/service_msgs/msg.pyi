"""The messages of service_msgs."""

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from metaros.idl import Message
from metaros.interfaces.builtin_interfaces import msg as builtin_interfaces_msg

class ServiceEventInfo(Message):
    REQUEST_SENT: Final = 0
    REQUEST_RECEIVED: Final = 1
    RESPONSE_SENT: Final = 2
    RESPONSE_RECEIVED: Final = 3
    event_type: int
    stamp: builtin_interfaces_msg.Time
    client_gid: npt.NDArray[np.uint8]
    sequence_number: int
    def __init__(
        self,
        *,
        event_type: int = ...,
        stamp: builtin_interfaces_msg.Time = ...,
        client_gid: npt.NDArray[Any] | Sequence[int] | bytes | bytearray | memoryview = ...,
        sequence_number: int = ...,
    ) -> None: ...
