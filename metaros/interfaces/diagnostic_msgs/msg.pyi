"""The messages of diagnostic_msgs."""

from typing import Final

from metaros.idl import Message
from metaros.interfaces.std_msgs import msg as std_msgs_msg

class DiagnosticArray(Message):
    header: std_msgs_msg.Header
    status: list[DiagnosticStatus]
    def __init__(
        self,
        *,
        header: std_msgs_msg.Header = ...,
        status: list[DiagnosticStatus] = ...,
    ) -> None: ...

class DiagnosticStatus(Message):
    OK: Final = 0
    WARN: Final = 1
    ERROR: Final = 2
    STALE: Final = 3
    level: int
    name: str
    message: str
    hardware_id: str
    values: list[KeyValue]
    def __init__(
        self,
        *,
        level: int = ...,
        name: str = ...,
        message: str = ...,
        hardware_id: str = ...,
        values: list[KeyValue] = ...,
    ) -> None: ...

class KeyValue(Message):
    key: str
    value: str
    def __init__(
        self,
        *,
        key: str = ...,
        value: str = ...,
    ) -> None: ...
