"""Looking up in the buffer of another node, by its action."""

from __future__ import annotations

import warnings
from typing import Any

from metaros.clock import SystemClock
from metaros.concurrency.waiting import Wakeup
from metaros.ros2.rclpy.time.duration import Duration
from metaros.ros2.rosidl.catalogue import interface
from metaros.ros2.tf2_py.conversions import duration_ns
from metaros.ros2.tf2_py.exceptions import (
    ConnectivityException,
    ExtrapolationException,
    InvalidArgumentException,
    LookupException,
    TimeoutException,
    TransformException,
)
from metaros.ros2.tf2_ros.buffer_interface import BufferInterface

__all__ = ["BufferClient"]

_ERRORS: dict[str, type[TransformException]] = {
    "LOOKUP_ERROR": LookupException,
    "CONNECTIVITY_ERROR": ConnectivityException,
    "EXTRAPOLATION_ERROR": ExtrapolationException,
    "INVALID_ARGUMENT_ERROR": InvalidArgumentException,
    "TIMEOUT_ERROR": TimeoutException,
}


class BufferClient(BufferInterface):
    """Asks the buffer server with the action name `ns`, such as C++'s `buffer_server`.

    A lookup waits for its answer: another thread has to spin the node. It is given up `timeout_padding` (2 s) after
    its own timeout. `check_frequency` is taken as tf2_ros does, and not needed: an answer ends the wait at once.
    """

    def __init__(self, node: Any, ns: str, check_frequency: float = 10.0, timeout_padding: Any = None) -> None:
        from metaros.ros2.rclpy.action.client import ActionClient

        super().__init__()
        self.node = node
        self.action_client = ActionClient(node, interface("tf2_msgs/action/LookupTransform"), action_name=ns)
        self.check_frequency = check_frequency
        self.timeout_padding = Duration(seconds=2.0) if timeout_padding is None else timeout_padding

    def lookup_transform(self, target_frame: str, source_frame: str, time: Any, timeout: Any = None) -> Any:
        """The `TransformStamped` from source to target.

        Raises:
            TimeoutException: the server is not there, or did not answer.
            TransformException: what the server says.
        """
        return self.__ask(timeout, target_frame=target_frame, source_frame=source_frame, source_time=_time(time))

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
        return self.__ask(
            timeout,
            target_frame=target_frame,
            source_frame=source_frame,
            source_time=_time(source_time),
            target_time=_time(target_time),
            fixed_frame=fixed_frame,
            advanced=True,
        )

    def can_transform(self, target_frame: str, source_frame: str, time: Any, timeout: Any = None) -> bool:
        """Whether `lookup_transform` answers."""
        try:
            self.lookup_transform(target_frame, source_frame, time, timeout)
        except TransformException:
            return False
        return True

    def can_transform_full(
        self,
        target_frame: str,
        target_time: Any,
        source_frame: str,
        source_time: Any,
        fixed_frame: str,
        timeout: Any = None,
    ) -> bool:
        """Whether `lookup_transform_full` answers."""
        try:
            self.lookup_transform_full(target_frame, target_time, source_frame, source_time, fixed_frame, timeout)
        except TransformException:
            return False
        return True

    def __ask(self, timeout: Any, **fields: Any) -> Any:
        if not self.action_client.server_is_ready():
            raise TimeoutException("The BufferServer is not ready.")
        wait = Duration() if timeout is None else timeout
        goal = interface("tf2_msgs/action/LookupTransform").Goal(timeout=wait.to_msg(), **fields)
        padding = self.timeout_padding
        padding_s = float(padding) if isinstance(padding, (int, float)) else duration_ns(padding) / 1e9
        until_s = SystemClock().monotonic_s() + duration_ns(wait) / 1e9 + padding_s
        context = self.node.context
        handle = _result(self.action_client.send_goal_async(goal), until_s, "take the goal", context)
        if not handle.accepted:
            raise TimeoutException("The BufferServer refused the goal of a lookup; something is wrong with it.")
        return _said(_result(handle.get_result_async(), until_s, "give its result", context).result)


def _result(future: Any, until_s: float, what: str, context: Any) -> Any:
    woken = Wakeup()
    future.add_done_callback(lambda _: woken.set())
    stop = context.wake_with(woken.set)
    try:
        while not future.done():
            if not context.ok():
                raise TimeoutException(f"The BufferServer did not {what} before the context was shut down.")
            if not woken.wait(until_s - SystemClock().monotonic_s()) and not future.done():
                raise TimeoutException(f"The BufferServer did not {what} in time; is the node spun by another thread?")
        return future.result()
    finally:
        stop()


def _said(result: Any) -> Any:
    error = result.error
    if error.error == error.NO_ERROR:
        return result.transform
    for name, kind in _ERRORS.items():
        if error.error == getattr(error, name):
            raise kind(error.error_string)
    raise TransformException(error.error_string)


def _time(time: Any) -> Any:
    if isinstance(time, interface("builtin_interfaces/msg/Time")):
        warnings.warn(
            "Passing a builtin_interfaces.msg.Time is deprecated: pass an rclpy.time.Time instead.", stacklevel=4
        )
        return time
    if not hasattr(time, "to_msg"):
        raise TypeError(f"Must pass an rclpy.time.Time object, not {type(time).__name__}")
    return time.to_msg()
