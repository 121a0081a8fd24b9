"""A node's buffer of transforms: waits for those that are to come."""

from __future__ import annotations

import itertools
import logging
import threading
from collections.abc import Callable
from typing import Any

from metaros.clock import SystemClock
from metaros.concurrency.waiting import Wakeup
from metaros.ros2.rclpy.execution.task import Future
from metaros.ros2.rclpy.time.clock import Clock, JumpThreshold
from metaros.ros2.rclpy.time.duration import Duration
from metaros.ros2.rosidl.catalogue import interface
from metaros.ros2.tf2_py.buffer_core import BufferCore
from metaros.ros2.tf2_py.conversions import duration_ns
from metaros.ros2.tf2_ros.buffer_interface import BufferInterface

__all__ = ["Buffer"]

_log = logging.getLogger("metaros.ros2.tf2")

Answer = tuple[bool, str]


class Buffer(BufferCore, BufferInterface):
    """Transforms of the last `cache_time` (10 s), which a `TransformListener` puts in.

    With a node it offers the service `tf2_frames`, and forgets everything when the node's clock jumps back by a second
    or more, as it does when a recording begins anew.

    A lookup with a timeout waits on its own thread: what puts the transforms in must run on another, such as an
    executor with several threads, or a listener made with `spin_thread=True`. With a node it ends with its context.
    """

    def __init__(self, cache_time: Any = None, node: Any = None) -> None:
        BufferCore.__init__(self, cache_time)
        BufferInterface.__init__(self)
        self.__watchers: dict[int, Callable[[], None]] = {}
        self.__numbers = itertools.count()
        self.__watching = threading.Lock()
        self.__context: Any = getattr(node, "context", None)
        if node is not None:
            self.srv = node.create_service(interface("tf2_msgs/srv/FrameGraph"), "tf2_frames", self.__tell_frames)
            self.clock = node.get_clock()
        else:
            self.clock = Clock()
        threshold = JumpThreshold(min_forward=None, min_backward=Duration(seconds=-1), on_clock_change=True)
        self.jump_handle = self.clock.create_jump_callback(threshold, post_callback=self.time_jump_callback)

    def time_jump_callback(self, time_jump: Any) -> None:
        """What the clock calls when it jumped: what is stored is of another time."""
        _log.warning("Detected jump back in time. The transforms of the buffer are forgotten.")
        self.clear()

    def set_transform(self, transform: Any, authority: str) -> None:
        """Keep a `TransformStamped`, and wake who waits for it."""
        super().set_transform(transform, authority)
        self.__news()

    def set_transform_static(self, transform: Any, authority: str) -> None:
        """Keep a `TransformStamped` for good, and wake who waits for it."""
        super().set_transform_static(transform, authority)
        self.__news()

    def lookup_transform(self, target_frame: str, source_frame: str, time: Any, timeout: Any = None) -> Any:
        """The `TransformStamped` that takes data in `source_frame` to `target_frame`; waits for it up to `timeout`.

        Raises:
            TransformException: why there is none, as `BufferCore.lookup_transform_core`.
        """
        self.__waited(lambda: self.can_transform_core(target_frame, source_frame, time), timeout)
        return self.lookup_transform_core(target_frame, source_frame, time)

    def lookup_transform_full(
        self,
        target_frame: str,
        target_time: Any,
        source_frame: str,
        source_time: Any,
        fixed_frame: str,
        timeout: Any = None,
    ) -> Any:
        """The same between two times, by way of a frame that does not move in between."""
        asked = (target_frame, target_time, source_frame, source_time, fixed_frame)
        self.__waited(lambda: self.can_transform_full_core(*asked), timeout)
        return self.lookup_transform_full_core(*asked)

    async def lookup_transform_async(self, target_frame: str, source_frame: str, time: Any) -> Any:
        """The same, for callbacks that await: as long as it takes."""
        await self.wait_for_transform_async(target_frame, source_frame, time)
        return self.lookup_transform_core(target_frame, source_frame, time)

    async def lookup_transform_full_async(
        self, target_frame: str, target_time: Any, source_frame: str, source_time: Any, fixed_frame: str
    ) -> Any:
        """The same, for callbacks that await: as long as it takes."""
        asked = (target_frame, target_time, source_frame, source_time, fixed_frame)
        await self.wait_for_transform_full_async(*asked)
        return self.lookup_transform_full_core(*asked)

    def can_transform(
        self, target_frame: str, source_frame: str, time: Any, timeout: Any = None, return_debug_tuple: bool = False
    ) -> Any:
        """Whether there is such a transform, or comes within `timeout`; with the reason if a tuple is wanted."""
        answer = self.__waited(lambda: self.can_transform_core(target_frame, source_frame, time), timeout, last=True)
        return answer if return_debug_tuple else answer[0]

    def can_transform_full(
        self,
        target_frame: str,
        target_time: Any,
        source_frame: str,
        source_time: Any,
        fixed_frame: str,
        timeout: Any = None,
        return_debug_tuple: bool = False,
    ) -> Any:
        """The same between two times."""
        asked = (target_frame, target_time, source_frame, source_time, fixed_frame)
        answer = self.__waited(lambda: self.can_transform_full_core(*asked), timeout, last=True)
        return answer if return_debug_tuple else answer[0]

    def wait_for_transform_async(self, target_frame: str, source_frame: str, time: Any) -> Future[Any]:
        """A future of the transform: done at once where it is there, cancel it where it is wanted no more."""
        return self.__awaited(
            lambda: self.can_transform_core(target_frame, source_frame, time),
            lambda: self.lookup_transform_core(target_frame, source_frame, time),
        )

    def wait_for_transform_full_async(
        self, target_frame: str, target_time: Any, source_frame: str, source_time: Any, fixed_frame: str
    ) -> Future[Any]:
        """The same between two times."""
        asked = (target_frame, target_time, source_frame, source_time, fixed_frame)
        return self.__awaited(
            lambda: self.can_transform_full_core(*asked), lambda: self.lookup_transform_full_core(*asked)
        )

    def __tell_frames(self, request: Any, response: Any) -> Any:
        response.frame_yaml = self.all_frames_as_yaml()
        return response

    # ── waiting

    def __news(self) -> None:
        if self.__watchers:
            with self.__watching:
                watchers = tuple(self.__watchers.values())
            for watcher in watchers:
                watcher()

    def __watch(self, number: int, watcher: Callable[[], None]) -> None:
        with self.__watching:
            self.__watchers[number] = watcher

    def __unwatch(self, number: int) -> bool:
        """Whether it was there: one of several threads that may want to end a wait finds it so."""
        with self.__watching:
            return self.__watchers.pop(number, None) is not None

    def __waited(self, ask: Callable[[], Answer], timeout: Any, *, last: bool = False) -> Answer:
        """The answer when it is yes, or when the time is over. `last`: also where nothing is waited for."""
        timeout_ns = 0 if timeout is None else duration_ns(timeout)
        if timeout_ns <= 0:
            return ask() if last else (False, "")
        clock, woken, number = SystemClock(), Wakeup(), next(self.__numbers)
        until_s = clock.monotonic_s() + timeout_ns / 1e9
        context = self.__context
        self.__watch(number, woken.set)
        stop = None if context is None else context.wake_with(woken.set)
        try:
            while not (answer := ask())[0] and (context is None or context.ok()):
                if not woken.wait(until_s - clock.monotonic_s()):
                    break
        finally:
            self.__unwatch(number)
            if stop is not None:
                stop()
        return answer

    def __awaited(self, ask: Callable[[], Answer], look_up: Callable[[], Any]) -> Future[Any]:
        future: Future[Any] = Future()
        number = next(self.__numbers)

        def news() -> None:
            if not ask()[0]:
                return
            try:
                found = look_up()
            except Exception as error:  # whatever it is, who awaits is to be told
                if self.__unwatch(number):
                    future.set_exception(error)
            else:
                if self.__unwatch(number):
                    future.set_result(found)

        self.__watch(number, news)
        news()  # after it is watched for, so that nothing comes in between unseen
        if not future.done():
            future.add_done_callback(lambda _: self.__unwatch(number))
        return future
