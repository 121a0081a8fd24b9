"""Types as a program on DDS writes them by hand, beside those of tests/metaros/dds/dds_types.py."""

# Not `from __future__ import annotations`: cyclonedds reads them.

from dataclasses import dataclass

from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import uint8, uint32

from tests.metaros.dds.dds_types import AddRequest, AddResponse, LaserScan, String, Time, Twist

__all__ = ["TYPES", "AddRequest", "AddResponse"]


@dataclass
class Clock(IdlStruct, typename="rosgraph_msgs.msg.dds_.Clock_"):  # type: ignore[call-arg]
    clock: Time


@dataclass
class Log(IdlStruct, typename="rcl_interfaces.msg.dds_.Log_"):  # type: ignore[call-arg]
    stamp: Time
    level: uint8
    name: str
    msg: str
    file: str
    function: str
    line: uint32


TYPES = {
    "std_msgs/msg/String": String,
    "geometry_msgs/msg/Twist": Twist,
    "sensor_msgs/msg/LaserScan": LaserScan,
    "rosgraph_msgs/msg/Clock": Clock,
    "rcl_interfaces/msg/Log": Log,
}
