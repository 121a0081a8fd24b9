"""Descriptions of types as the raw peer tells them, and the hash of any description: REP-2011 by the standard alone."""

from __future__ import annotations

import hashlib
import json

from tests.ros2.participant import Fields
from tests.ros2.raw.layouts import HASHES

__all__ = ["ODD", "ODD_HASH", "TELL", "rihs01", "tell"]

TELL = "type_description_interfaces/srv/GetTypeDescription"
ODD = "kit_msgs/msg/Odd"  # nobody else has it
NESTED, INT16, INT32, UINT32, FLOAT, STRING = 1, 4, 6, 7, 10, 17
SEQUENCE = 144


def rihs01(parts: list[Fields]) -> str:
    """Of a type and those that it refers to: descriptions without defaults, as JSON, by SHA-256."""

    def plain(part: Fields) -> Fields:
        fields = [{"name": field["name"], "type": dict(field["type"])} for field in part["fields"]]
        return {"type_name": part["type_name"], "fields": fields}

    first, *others = map(plain, parts)
    text = json.dumps({"type_description": first, "referenced_type_descriptions": others})
    return f"RIHS01_{hashlib.sha256(text.encode()).hexdigest()}"


def _part(type_name: str, *fields: tuple[str, int, str]) -> Fields:
    listed = []
    for name, type_id, nested in fields:
        kind = {"type_id": type_id, "capacity": 0, "string_capacity": 0, "nested_type_name": nested}
        listed.append({"name": name, "type": kind, "default_value": ""})
    return {"type_name": type_name, "fields": listed}


_STRING = _part("std_msgs/msg/String", ("data", STRING, ""))
_TIME = _part("builtin_interfaces/msg/Time", ("sec", INT32, ""), ("nanosec", UINT32, ""))
_HEADER = _part("std_msgs/msg/Header", ("stamp", NESTED, "builtin_interfaces/msg/Time"), ("frame_id", STRING, ""))
_FLOATS = ("angle_min", "angle_max", "angle_increment", "time_increment", "scan_time", "range_min", "range_max")
_SCAN = _part(
    "sensor_msgs/msg/LaserScan",
    ("header", NESTED, "std_msgs/msg/Header"),
    *((name, FLOAT, "") for name in _FLOATS),
    ("ranges", FLOAT + SEQUENCE, ""),
    ("intensities", FLOAT + SEQUENCE, ""),
)
_ODD = _part(ODD, ("head", NESTED, "std_msgs/msg/String"), ("numbers", INT16 + SEQUENCE, ""))
ODD_HASH = rihs01([_ODD, _STRING])
_TOLD = {HASHES["sensor_msgs/msg/LaserScan"]: [_SCAN, _TIME, _HEADER], ODD_HASH: [_ODD, _STRING]}


def tell(request: Fields) -> Fields:
    """The service's answer: by the hash, as ROS 2 Jazzy does."""
    parts = _TOLD.get(request["type_hash"])
    first, *others = parts or [_part("")]
    return {
        "successful": parts is not None,
        "failure_reason": "" if parts else "Type not currently in use by this node",
        "type_description": {"type_description": first, "referenced_type_descriptions": others},
        "type_sources": [],
        "extra_information": [],
    }
