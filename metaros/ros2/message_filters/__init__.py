"""`message_filters`: subscriptions whose messages are kept by time, and put together by time."""

from __future__ import annotations

from metaros.ros2.message_filters.cache import Cache
from metaros.ros2.message_filters.chain import Chain
from metaros.ros2.message_filters.simple_filter import SimpleFilter, Subscriber
from metaros.ros2.message_filters.synchronizers import ApproximateTimeSynchronizer, TimeSynchronizer

__all__ = [
    "ApproximateTimeSynchronizer",
    "Cache",
    "Chain",
    "SimpleFilter",
    "Subscriber",
    "TimeSynchronizer",
]
