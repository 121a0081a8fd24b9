"""`sensor_msgs_py`: point clouds as numpy arrays, in `sensor_msgs_py.point_cloud2`."""

from __future__ import annotations

__all__: list[str] = []
