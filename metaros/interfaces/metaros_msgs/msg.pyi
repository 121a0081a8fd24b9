# ruff: noqa: A002
"""The messages of metaros_msgs."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from metaros.idl import Message
from metaros.interfaces.builtin_interfaces import msg as builtin_interfaces_msg
from metaros.interfaces.std_msgs import msg as std_msgs_msg

class AudioPacket(Message):
    stamp: builtin_interfaces_msg.Time
    codec: str
    sample_rate: int
    channels: int
    samples: int
    data: npt.NDArray[np.uint8]
    def __init__(
        self,
        *,
        stamp: builtin_interfaces_msg.Time = ...,
        codec: str = ...,
        sample_rate: int = ...,
        channels: int = ...,
        samples: int = ...,
        data: npt.NDArray[Any] | Sequence[int] | bytes | bytearray | memoryview = ...,
    ) -> None: ...

class Bytes(Message):
    data: npt.NDArray[np.uint8]
    def __init__(
        self,
        *,
        data: npt.NDArray[Any] | Sequence[int] | bytes | bytearray | memoryview = ...,
    ) -> None: ...

class HostCpu(Message):
    stamp: builtin_interfaces_msg.Time
    percent: float
    per_core: npt.NDArray[np.float64]
    load_1m: float
    count: int
    def __init__(
        self,
        *,
        stamp: builtin_interfaces_msg.Time = ...,
        percent: float = ...,
        per_core: npt.NDArray[Any] | Sequence[float] = ...,
        load_1m: float = ...,
        count: int = ...,
    ) -> None: ...

class HostDisk(Message):
    stamp: builtin_interfaces_msg.Time
    path: str
    percent: float
    used_bytes: int
    total_bytes: int
    read_bytes_per_s: float
    write_bytes_per_s: float
    def __init__(
        self,
        *,
        stamp: builtin_interfaces_msg.Time = ...,
        path: str = ...,
        percent: float = ...,
        used_bytes: int = ...,
        total_bytes: int = ...,
        read_bytes_per_s: float = ...,
        write_bytes_per_s: float = ...,
    ) -> None: ...

class HostMemory(Message):
    stamp: builtin_interfaces_msg.Time
    percent: float
    used_bytes: int
    total_bytes: int
    available_bytes: int
    def __init__(
        self,
        *,
        stamp: builtin_interfaces_msg.Time = ...,
        percent: float = ...,
        used_bytes: int = ...,
        total_bytes: int = ...,
        available_bytes: int = ...,
    ) -> None: ...

class HostNetwork(Message):
    stamp: builtin_interfaces_msg.Time
    rx_bytes_per_s: float
    tx_bytes_per_s: float
    rx_bytes: int
    tx_bytes: int
    def __init__(
        self,
        *,
        stamp: builtin_interfaces_msg.Time = ...,
        rx_bytes_per_s: float = ...,
        tx_bytes_per_s: float = ...,
        rx_bytes: int = ...,
        tx_bytes: int = ...,
    ) -> None: ...

class HostTemperature(Message):
    stamp: builtin_interfaces_msg.Time
    celsius: float
    sensor: str
    names: list[str]
    values: npt.NDArray[np.float64]
    def __init__(
        self,
        *,
        stamp: builtin_interfaces_msg.Time = ...,
        celsius: float = ...,
        sensor: str = ...,
        names: list[str] = ...,
        values: npt.NDArray[Any] | Sequence[float] = ...,
    ) -> None: ...

class Json(Message):
    data: str
    def __init__(
        self,
        *,
        data: str = ...,
    ) -> None: ...

class NodeEvent(Message):
    stamp: builtin_interfaces_msg.Time
    node: str
    kind: str
    reason: str
    pid: int
    restarts: int
    def __init__(
        self,
        *,
        stamp: builtin_interfaces_msg.Time = ...,
        node: str = ...,
        kind: str = ...,
        reason: str = ...,
        pid: int = ...,
        restarts: int = ...,
    ) -> None: ...

class QuantizedCloud(Message):
    header: std_msgs_msg.Header
    count: int
    origin: npt.NDArray[np.float64]
    step_m: float
    has_intensity: bool
    data: npt.NDArray[np.uint8]
    def __init__(
        self,
        *,
        header: std_msgs_msg.Header = ...,
        count: int = ...,
        origin: npt.NDArray[Any] | Sequence[float] = ...,
        step_m: float = ...,
        has_intensity: bool = ...,
        data: npt.NDArray[Any] | Sequence[int] | bytes | bytearray | memoryview = ...,
    ) -> None: ...

class TopicRate(Message):
    topic: str
    type: str
    rate_hz: float
    bytes_per_s: float
    messages: int
    dropped: int
    def __init__(
        self,
        *,
        topic: str = ...,
        type: str = ...,
        rate_hz: float = ...,
        bytes_per_s: float = ...,
        messages: int = ...,
        dropped: int = ...,
    ) -> None: ...

class TopicRates(Message):
    stamp: builtin_interfaces_msg.Time
    topics: list[TopicRate]
    def __init__(
        self,
        *,
        stamp: builtin_interfaces_msg.Time = ...,
        topics: list[TopicRate] = ...,
    ) -> None: ...

class VehicleState(Message):
    stamp: builtin_interfaces_msg.Time
    connected: bool
    armed: bool
    mode: str
    vehicle: str
    autopilot: str
    status: str
    def __init__(
        self,
        *,
        stamp: builtin_interfaces_msg.Time = ...,
        connected: bool = ...,
        armed: bool = ...,
        mode: str = ...,
        vehicle: str = ...,
        autopilot: str = ...,
        status: str = ...,
    ) -> None: ...

class VideoDemand(Message):
    key_frame: bool
    viewers: int
    bitrate_bps: int
    def __init__(
        self,
        *,
        key_frame: bool = ...,
        viewers: int = ...,
        bitrate_bps: int = ...,
    ) -> None: ...

class VideoPacket(Message):
    header: std_msgs_msg.Header
    codec: str
    key_frame: bool
    pts: int
    width: int
    height: int
    data: npt.NDArray[np.uint8]
    def __init__(
        self,
        *,
        header: std_msgs_msg.Header = ...,
        codec: str = ...,
        key_frame: bool = ...,
        pts: int = ...,
        width: int = ...,
        height: int = ...,
        data: npt.NDArray[Any] | Sequence[int] | bytes | bytearray | memoryview = ...,
    ) -> None: ...
