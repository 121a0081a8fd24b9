"""Messages of several filters that belong together by their times."""

from __future__ import annotations

import threading
from bisect import bisect_left
from collections.abc import Sequence
from typing import Any

from metaros.ros2.message_filters.simple_filter import SimpleFilter, now, stamp_of
from metaros.ros2.rclpy.time.duration import Duration

__all__ = ["ApproximateTimeSynchronizer", "TimeSynchronizer"]

Queue = dict[int, Any]  # messages by their times in nanoseconds


class TimeSynchronizer(SimpleFilter):
    """Puts out one message of each filter of `fs`, all of the same time, as soon as the last of them has come.

    Of each filter the `queue_size` messages of the newest times wait. Sets come out one at a time, and in the order
    of their times where several become complete at once.
    """

    def __init__(self, fs: Sequence[SimpleFilter], queue_size: int) -> None:
        super().__init__()
        self.lock = threading.RLock()
        self.queue_size = queue_size
        self.connectInput(fs)

    def connectInput(self, fs: Sequence[SimpleFilter]) -> None:
        """Take what these filters put out, in this order."""
        self.queues: list[Queue] = [{} for _ in fs]
        self.input_connections = [
            f.registerCallback(self.add, queue, index)
            for index, (f, queue) in enumerate(zip(fs, self.queues, strict=True))
        ]

    def add(self, msg: Any, my_queue: Queue, my_queue_index: int | None = None) -> None:
        """Take a message in that is for this queue."""
        stamp = stamp_of(msg, False, "message_filters_time")
        if stamp is None:
            return
        with self.lock:
            self._keep(my_queue, stamp.nanoseconds, msg)
            common = set.intersection(*(set(queue) for queue in self.queues))
            sets = [[queue.pop(time_ns) for queue in self.queues] for time_ns in sorted(common)]
            for messages in sets:
                self.signalMessage(*messages)

    def _keep(self, queue: Queue, time_ns: int, message: Any) -> None:
        queue[time_ns] = message
        while len(queue) > self.queue_size:
            del queue[min(queue)]


class ApproximateTimeSynchronizer(TimeSynchronizer):
    """Puts out one message of each filter whose times lie less than `slop` seconds apart.

    What is nearest in time to the message that has just come goes first; what does not come out waits. With
    `allow_headerless` a message without a header counts from when it came, with `sync_arrival_time` every message.
    """

    def __init__(
        self,
        fs: Sequence[SimpleFilter],
        queue_size: int,
        slop: float,
        allow_headerless: bool = False,
        sync_arrival_time: bool = False,
    ) -> None:
        super().__init__(fs, queue_size)
        self.slop = Duration(seconds=slop)
        self.allow_headerless = allow_headerless
        self.sync_arrival_time = sync_arrival_time

    def add(self, msg: Any, my_queue: Queue, my_queue_index: int | None = None) -> None:
        """Take a message in that is for this queue; without the index all queues are searched, its own included."""
        stamp = now() if self.sync_arrival_time else stamp_of(msg, self.allow_headerless, "message_filters_approx")
        if stamp is None:
            return
        with self.lock:
            time_ns, slop_ns = stamp.nanoseconds, self.slop.nanoseconds
            self._keep(my_queue, time_ns, msg)
            if my_queue_index is not None and time_ns not in my_queue:
                return  # older than all that wait, and no more room
            choices = [
                [time_ns] if index == my_queue_index else _nearest(queue, time_ns, slop_ns)
                for index, queue in enumerate(self.queues)
            ]
            times = _chosen(choices, slop_ns) if all(choices) else None
            if times is not None:
                messages = [queue.pop(chosen) for queue, chosen in zip(self.queues, times, strict=True)]
                self.signalMessage(*messages)


def _nearest(queue: Queue, time_ns: int, slop_ns: int) -> list[int]:
    """Times in the queue, from the nearest on; of two as near the one that came first."""
    return sorted((at for at in queue if abs(at - time_ns) <= slop_ns), key=lambda at: abs(at - time_ns))


def _chosen(choices: list[list[int]], slop_ns: int) -> list[int] | None:
    """One time of each list, less than `slop_ns` apart: of all ways the one that takes the first times of the lists,
    the first list's before the second's. None where there is no way.

    It never goes back: a time is taken when the lists that follow can be served with it.
    """
    ordered = [sorted(times) for times in choices]
    chosen: list[int] = []
    for index, times in enumerate(choices):
        for at in times:
            so_far = (*chosen, at)
            if _possible(min(so_far), max(so_far), ordered[index + 1 :], slop_ns):
                chosen.append(at)
                break
        else:
            return None
    return chosen


def _possible(low: int, high: int, rest: list[list[int]], slop_ns: int) -> bool:
    """Whether some span of that length holds both times and one of each list: it may begin with any of them."""
    starts = [low, *(at for times in rest for at in times if at < low)]
    return any(
        high - start < slop_ns
        and all((place := bisect_left(times, start)) < len(times) and times[place] - start < slop_ns for times in rest)
        for start in starts
    )
