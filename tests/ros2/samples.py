"""Messages of the scenarios, as plain values; the first three are those of tests/data/ros2_vectors.json."""

from __future__ import annotations

import math
from typing import Any

from tests.ros2.participant import Fields

__all__ = ["SAMPLES", "same"]

ZERO = {"x": 0.0, "y": 0.0, "z": 0.0}
SAMPLES: dict[str, Fields] = {
    "std_msgs/msg/String": {"data": "Hello World: 1"},
    "geometry_msgs/msg/Twist": {"linear": {**ZERO, "x": 0.5}, "angular": {**ZERO, "z": -1.25}},
    "sensor_msgs/msg/LaserScan": {
        "header": {"stamp": {"sec": 1_700_000_000, "nanosec": 123_456_789}, "frame_id": "laser"},
        "angle_min": -1.5,
        "angle_max": 1.5,
        "angle_increment": 1.0,
        "time_increment": 0.0,
        "scan_time": 0.1,
        "range_min": 0.05,
        "range_max": 30.0,
        "ranges": [1.0, 2.5, math.inf, 4.0],
        "intensities": [],
    },
}


def same(one: Any, other: Any) -> bool:
    """Whether two messages say the same; numbers may have been float32 or text on their way, infinity None in ours."""
    if isinstance(one, dict):
        return isinstance(other, dict) and one.keys() == other.keys() and all(same(one[key], other[key]) for key in one)
    if isinstance(one, list | tuple) or hasattr(one, "tolist"):
        return len(one) == len(other) and all(map(same, one, other))
    if isinstance(one, float) or isinstance(other, float):
        values = [math.inf if value is None else float(value) for value in (one, other)]
        return math.isclose(*values, rel_tol=1e-6)
    return bool(one == other)
