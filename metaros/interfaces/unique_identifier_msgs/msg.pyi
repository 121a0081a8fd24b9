"""The messages of unique_identifier_msgs."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from metaros.idl import Message

class UUID(Message):
    uuid: npt.NDArray[np.uint8]
    def __init__(
        self,
        *,
        uuid: npt.NDArray[Any] | Sequence[int] | bytes | bytearray | memoryview = ...,
    ) -> None: ...
