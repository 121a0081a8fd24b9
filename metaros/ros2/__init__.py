"""ROS 2 programs on this library: rclpy's shape, message modules, and what else such programs import.

    import metaros.ros2
    metaros.ros2.install()

    import rclpy
    from std_msgs.msg import String

`python -m metaros.ros2 FILE` and `metaros ros2 run` do that for programs that are not to be changed.
"""

from __future__ import annotations

from metaros.ros2.finder import install, installed, uninstall

__all__ = ["install", "installed", "uninstall"]
