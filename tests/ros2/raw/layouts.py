"""The types of the scenarios as they are on the wire, from the public interface definitions of ROS 2, by hand."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

__all__ = ["HASHES", "LAYOUTS", "NO_HASH", "dds_name"]

_DATA = Path(__file__).parents[2] / "data" / "ros2_rihs01.json"
HASHES: dict[str, str] = json.loads(_DATA.read_text())["distros"]["jazzy"]["hashes"]  # by the real generator
NO_HASH = "TypeHashNotSupported"  # what Humble writes

TIME = {"sec": "i", "nanosec": "I"}
VECTOR = {"x": "d", "y": "d", "z": "d"}
UUID = {"uuid": ("B", 16)}
GOAL_INFO = {"goal_id": UUID, "stamp": TIME}
NUMBERS = ["i"]
VALUE = {
    "type": "B",
    "bool_value": "?",
    "integer_value": "q",
    "double_value": "d",
    "string_value": "s",
    "byte_array_value": ["B"],
    "bool_array_value": ["?"],
    "integer_array_value": ["q"],
    "double_array_value": ["d"],
    "string_array_value": ["s"],
}
PARAMETER = {"name": "s", "value": VALUE}
RESULT = {"successful": "?", "reason": "s"}
DESCRIPTOR = {
    "name": "s",
    "type": "B",
    "description": "s",
    "additional_constraints": "s",
    "read_only": "?",
    "dynamic_typing": "?",
    "floating_point_range": [{"from_value": "d", "to_value": "d", "step": "d"}],
    "integer_range": [{"from_value": "q", "to_value": "q", "step": "Q"}],
}
STATE = {"id": "B", "label": "s"}
FIELD_TYPE = {"type_id": "B", "capacity": "Q", "string_capacity": "Q", "nested_type_name": "s"}
DESCRIPTION = {"type_name": "s", "fields": [{"name": "s", "type": FIELD_TYPE, "default_value": "s"}]}
SOURCE = {"type_name": "s", "encoding": "s", "raw_file_contents": "s"}

LAYOUTS: dict[str, Any] = {
    "std_msgs/msg/String": {"data": "s"},
    "geometry_msgs/msg/Twist": {"linear": VECTOR, "angular": VECTOR},
    "sensor_msgs/msg/LaserScan": {
        "header": {"stamp": TIME, "frame_id": "s"},
        "angle_min": "f",
        "angle_max": "f",
        "angle_increment": "f",
        "time_increment": "f",
        "scan_time": "f",
        "range_min": "f",
        "range_max": "f",
        "ranges": ["f"],
        "intensities": ["f"],
    },
    "kit_msgs/msg/Odd": {"head": {"data": "s"}, "numbers": ["h"]},
    "rosgraph_msgs/msg/Clock": {"clock": TIME},
    "rcl_interfaces/msg/Log": {
        "stamp": TIME,
        "level": "B",
        "name": "s",
        "msg": "s",
        "file": "s",
        "function": "s",
        "line": "I",
    },
    "rcl_interfaces/msg/ParameterEvent": {
        "stamp": TIME,
        "node": "s",
        "new_parameters": [PARAMETER],
        "changed_parameters": [PARAMETER],
        "deleted_parameters": [PARAMETER],
    },
    "lifecycle_msgs/msg/TransitionEvent": {
        "timestamp": "Q",
        "transition": STATE,
        "start_state": STATE,
        "goal_state": STATE,
    },
    "action_msgs/msg/GoalStatusArray": {"status_list": [{"goal_info": GOAL_INFO, "status": "b"}]},
    "example_interfaces/action/Fibonacci_FeedbackMessage": {"goal_id": UUID, "feedback": {"sequence": NUMBERS}},
    # Services: request, response.
    "example_interfaces/srv/AddTwoInts": ({"a": "q", "b": "q"}, {"sum": "q"}),
    "std_srvs/srv/Trigger": ({}, {"success": "?", "message": "s"}),
    "example_interfaces/action/Fibonacci_SendGoal": (
        {"goal_id": UUID, "goal": {"order": "i"}},
        {"accepted": "?", "stamp": TIME},
    ),
    "example_interfaces/action/Fibonacci_GetResult": (
        {"goal_id": UUID},
        {"status": "b", "result": {"sequence": NUMBERS}},
    ),
    "action_msgs/srv/CancelGoal": (
        {"goal_info": GOAL_INFO},
        {"return_code": "b", "goals_canceling": [GOAL_INFO]},
    ),
    "rcl_interfaces/srv/ListParameters": (
        {"prefixes": ["s"], "depth": "Q"},
        {"result": {"names": ["s"], "prefixes": ["s"]}},
    ),
    "rcl_interfaces/srv/GetParameters": ({"names": ["s"]}, {"values": [VALUE]}),
    "rcl_interfaces/srv/SetParameters": ({"parameters": [PARAMETER]}, {"results": [RESULT]}),
    "rcl_interfaces/srv/SetParametersAtomically": ({"parameters": [PARAMETER]}, {"result": RESULT}),
    "rcl_interfaces/srv/GetParameterTypes": ({"names": ["s"]}, {"types": ["B"]}),
    "rcl_interfaces/srv/DescribeParameters": ({"names": ["s"]}, {"descriptors": [DESCRIPTOR]}),
    "lifecycle_msgs/srv/GetState": ({}, {"current_state": STATE}),
    "lifecycle_msgs/srv/ChangeState": ({"transition": STATE}, {"success": "?"}),
    "type_description_interfaces/srv/GetTypeDescription": (
        {"type_name": "s", "type_hash": "s", "include_type_sources": "?"},
        {
            "successful": "?",
            "failure_reason": "s",
            "type_description": {"type_description": DESCRIPTION, "referenced_type_descriptions": [DESCRIPTION]},
            "type_sources": [SOURCE],
            "extra_information": [{"key": "s", "value": "s"}],
        },
    ),
}


def dds_name(type_name: str) -> str:
    """`std_msgs/msg/String` as it stands in keys and tokens."""
    package, kind, name = type_name.split("/")
    return f"{package}::{kind}::dds_::{name}_"
