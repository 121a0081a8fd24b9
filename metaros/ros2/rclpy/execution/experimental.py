"""`rclpy.experimental`: the executor that is told of events instead of asking; here every executor is."""

from __future__ import annotations

from metaros.ros2.rclpy.execution.executors import SingleThreadedExecutor

__all__ = ["EventsExecutor"]


class EventsExecutor(SingleThreadedExecutor):
    """The single-threaded executor by another name: it waits on one queue of arrivals already."""
