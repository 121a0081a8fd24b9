"""Types as a program on DDS writes them by hand, without anything of ours."""

# Not `from __future__ import annotations`: cyclonedds reads them.

from dataclasses import dataclass

from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import float32, float64, int32, int64, sequence, uint32, uint64


@dataclass
class String(IdlStruct, typename="std_msgs.msg.dds_.String_"):  # type: ignore[call-arg]
    data: str


@dataclass
class Time(IdlStruct, typename="builtin_interfaces.msg.dds_.Time_"):  # type: ignore[call-arg]
    sec: int32
    nanosec: uint32


@dataclass
class Header(IdlStruct, typename="std_msgs.msg.dds_.Header_"):  # type: ignore[call-arg]
    stamp: Time
    frame_id: str


@dataclass
class LaserScan(IdlStruct, typename="sensor_msgs.msg.dds_.LaserScan_"):  # type: ignore[call-arg]
    header: Header
    angle_min: float32
    angle_max: float32
    angle_increment: float32
    time_increment: float32
    scan_time: float32
    range_min: float32
    range_max: float32
    ranges: sequence[float32]
    intensities: sequence[float32]


@dataclass
class Vector3(IdlStruct, typename="geometry_msgs.msg.dds_.Vector3_"):  # type: ignore[call-arg]
    x: float64
    y: float64
    z: float64


@dataclass
class Twist(IdlStruct, typename="geometry_msgs.msg.dds_.Twist_"):  # type: ignore[call-arg]
    linear: Vector3
    angular: Vector3


@dataclass
class AddRequest(IdlStruct, typename="example_interfaces.srv.dds_.AddTwoInts_Request_"):  # type: ignore[call-arg]
    client_guid: uint64  # as rmw_cyclonedds_cpp puts it before the request
    sequence_number: int64
    a: int64
    b: int64


@dataclass
class AddResponse(IdlStruct, typename="example_interfaces.srv.dds_.AddTwoInts_Response_"):  # type: ignore[call-arg]
    client_guid: uint64
    sequence_number: int64
    sum: int64
