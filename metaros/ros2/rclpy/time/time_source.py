"""`rclpy.time_source`: a node's ROS time is a simulation's where the parameter `use_sim_time` says so."""

from __future__ import annotations

import weakref
from typing import Any, Final

from metaros.ros2.rclpy.execution.callback_groups import MutuallyExclusiveCallbackGroup
from metaros.ros2.rclpy.parameters.value import Parameter
from metaros.ros2.rclpy.qos.policies import ReliabilityPolicy
from metaros.ros2.rclpy.qos.profile import QoSProfile
from metaros.ros2.rclpy.time.clock import ROSClock
from metaros.ros2.rclpy.time.clock_type import ClockType
from metaros.ros2.rclpy.time.time import Time
from metaros.ros2.rosidl.catalogue import interface

__all__ = ["CLOCK_TOPIC", "USE_SIM_TIME_NAME", "TimeSource"]

CLOCK_TOPIC: Final = "/clock"
USE_SIM_TIME_NAME: Final = "use_sim_time"


class TimeSource:
    """Sets the ROS clocks that are attached to it: by /clock while the node's `use_sim_time` is true.

    The messages come to the executor that spins the node. A clock attached later gets the newest time that came.
    """

    def __init__(self, *, node: Any = None) -> None:
        self._clock_sub: Any = None
        self._node_weak_ref: weakref.ref[Any] | None = None
        self._associated_clocks: list[ROSClock] = []
        self._last_time_set = Time(clock_type=ClockType.ROS_TIME)  # what clocks show before the first message
        self._ros_time_is_active = False
        if node is not None:
            self.attach_node(node)

    @property
    def ros_time_is_active(self) -> bool:
        """Whether the clocks show simulated time."""
        return self._ros_time_is_active

    @ros_time_is_active.setter
    def ros_time_is_active(self, enabled: bool) -> None:
        if self._ros_time_is_active == enabled:
            return
        self._ros_time_is_active = enabled
        for clock in self._associated_clocks:
            clock._set_ros_time_is_active(enabled)
        if enabled:
            self._subscribe_to_clock_topic()
        else:
            self._unsubscribe()

    # -- the node --------------------------------------------------------------------------------------------------

    def attach_node(self, node: Any) -> None:
        """Go by this node's parameter, which is declared where it was not; TypeError where it is no node."""
        if not hasattr(node, "create_subscription"):
            raise TypeError(f"Node must be of type rclpy.node.Node, not {type(node).__name__}")
        if self._get_node() is not None:
            self.detach_node()
        self._node_weak_ref = weakref.ref(node)
        if not node.has_parameter(USE_SIM_TIME_NAME):
            node.declare_parameter(USE_SIM_TIME_NAME, False)
        parameter = node.get_parameter(USE_SIM_TIME_NAME)
        if parameter.type_ == Parameter.Type.BOOL:
            self.ros_time_is_active = parameter.value
        elif parameter.type_ != Parameter.Type.NOT_SET:
            node.get_logger().error(
                f"Invalid type for parameter {USE_SIM_TIME_NAME}: {parameter.type_}, it should be a bool"
            )
        node.add_on_set_parameters_callback(self._on_parameter_event)

    def detach_node(self) -> None:
        """Go by no node's parameter; the clocks stand where they are."""
        node = self._get_node()
        self._unsubscribe()
        if node is not None:
            node.remove_on_set_parameters_callback(self._on_parameter_event)
        self._node_weak_ref = None
        self._ros_time_is_active = False

    def _get_node(self) -> Any:
        return None if self._node_weak_ref is None else self._node_weak_ref()

    def _on_parameter_event(self, parameters: list[Parameter[Any]]) -> Any:
        result = interface("rcl_interfaces/msg/SetParametersResult")
        for parameter in parameters:
            if parameter.name != USE_SIM_TIME_NAME:
                continue
            if parameter.type_ != Parameter.Type.BOOL:
                reason = f"Invalid type for parameter {USE_SIM_TIME_NAME}: it should be a bool"
                return result(successful=False, reason=reason)
            self.ros_time_is_active = parameter.value
        return result(successful=True)

    def _subscribe_to_clock_topic(self) -> None:
        node = self._get_node()
        if self._clock_sub is None and node is not None:
            qos = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
            clock = interface("rosgraph_msgs/msg/Clock")
            group = MutuallyExclusiveCallbackGroup()  # of its own: callbacks of the node may wait for time to pass
            self._clock_sub = node.create_subscription(
                clock, CLOCK_TOPIC, self.clock_callback, qos, callback_group=group
            )

    def _unsubscribe(self) -> None:
        subscription, self._clock_sub = self._clock_sub, None
        node = self._get_node()
        if subscription is not None and node is not None:
            node.destroy_subscription(subscription)

    # -- the clocks ------------------------------------------------------------------------------------------------

    def attach_clock(self, clock: ROSClock) -> None:
        """Set this clock, too; ValueError unless it is a ROS clock."""
        if not isinstance(clock, ROSClock):
            raise ValueError(f"Only clocks with type ROS_TIME can be attached, not {clock!r}")
        clock.set_ros_time_override(self._last_time_set)
        clock._set_ros_time_is_active(self._ros_time_is_active)
        self._associated_clocks.append(clock)

    def clock_callback(self, msg: Any) -> None:
        """What /clock says."""
        self._last_time_set = Time.from_msg(msg.clock)
        for clock in self._associated_clocks:
            clock.set_ros_time_override(self._last_time_set)
