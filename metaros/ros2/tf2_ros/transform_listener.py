"""Hearing transforms: what comes on `/tf` and `/tf_static` goes into a buffer."""

from __future__ import annotations

import threading
from typing import Any, Final

from metaros.ros2.rclpy.execution.callback_groups import MutuallyExclusiveCallbackGroup
from metaros.ros2.rclpy.qos.profile import DurabilityPolicy, HistoryPolicy, QoSProfile
from metaros.ros2.rosidl.catalogue import interface

__all__ = ["DEFAULT_STATIC_TF_TOPIC", "DEFAULT_TF_TOPIC", "TransformListener"]

DEFAULT_TF_TOPIC: Final = "/tf"
DEFAULT_STATIC_TF_TOPIC: Final = "/tf_static"
_AUTHORITY: Final = "default_authority"  # who sent a message is not told to who receives it


class TransformListener:
    """Fills `buffer` for as long as the node lives, or until `unregister`.

    It hears when the node is spun; with `spin_thread` a thread of its own does that, and nobody else may. Without a
    node it makes one, which needs `spin_thread`. `static_only` leaves `/tf` out.
    """

    def __init__(
        self,
        buffer: Any,
        node: Any,
        *,
        spin_thread: bool = False,
        qos: Any = None,
        static_qos: Any = None,
        tf_topic: str = DEFAULT_TF_TOPIC,
        tf_static_topic: str = DEFAULT_STATIC_TF_TOPIC,
        static_only: bool = False,
    ) -> None:
        if node is None:
            node = _own_node(self)
        if qos is None:
            qos = QoSProfile(depth=100, durability=DurabilityPolicy.VOLATILE, history=HistoryPolicy.KEEP_LAST)
        if static_qos is None:
            static_qos = QoSProfile(
                depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL, history=HistoryPolicy.KEEP_LAST
            )
        self.buffer = buffer
        self.node = node
        # Of its own, so that a callback of the node may wait for a transform. tf2_ros has a reentrant one, in which an
        # executor with several threads may put messages in the wrong order: of static transforms the older would stay.
        self.group = MutuallyExclusiveCallbackGroup()
        message = interface("tf2_msgs/msg/TFMessage")
        if not static_only:
            self.tf_sub = node.create_subscription(message, tf_topic, self.callback, qos, callback_group=self.group)
        self.tf_static_sub = node.create_subscription(
            message, tf_static_topic, self.static_callback, static_qos, callback_group=self.group
        )
        if spin_thread:
            from metaros.ros2.rclpy.execution.executors import SingleThreadedExecutor

            self.executor = SingleThreadedExecutor(context=node.context)
            self.dedicated_listener_thread = threading.Thread(
                target=_spin, args=(self.executor, node), name="tf listener", daemon=True
            )
            self.dedicated_listener_thread.start()

    def __del__(self) -> None:
        executor = getattr(self, "executor", None)
        if executor is not None:
            executor.shutdown()
            if self.dedicated_listener_thread is not threading.current_thread():
                self.dedicated_listener_thread.join()
        self.unregister()

    def unregister(self) -> None:
        """Hear no more; safe to call twice."""
        for name in ("tf_sub", "tf_static_sub"):
            subscription = self.__dict__.pop(name, None)
            if subscription is not None:
                self.node.destroy_subscription(subscription)

    def callback(self, data: Any) -> None:
        """A message of `/tf`."""
        for transform in data.transforms:
            self.buffer.set_transform(transform, _AUTHORITY)

    def static_callback(self, data: Any) -> None:
        """A message of `/tf_static`."""
        for transform in data.transforms:
            self.buffer.set_transform_static(transform, _AUTHORITY)


def _spin(executor: Any, node: Any) -> None:
    from metaros.ros2.rclpy.execution.executors import ExternalShutdownException

    executor.add_node(node)
    try:
        executor.spin()
    except ExternalShutdownException:
        pass
    finally:
        executor.remove_node(node)


def _own_node(listener: TransformListener) -> Any:
    from metaros.ros2.rclpy.core.node import Node
    from metaros.ros2.rclpy.parameters.parameter import Parameter

    return Node(
        f"transform_listener_impl_{id(listener):010x}",
        enable_rosout=False,
        start_parameter_services=False,
        parameter_overrides=[Parameter("use_sim_time", value=False)],
    )
