"""Names that ROS 2's modules happen to have because they import them, and that programs take from there.

`from rclpy.node import Publisher`, `from rclpy.action.client import GoalStatus`, `from tf2_geometry_msgs import
PoseStamped`: editors write such lines, and in ROS 2 they work. Here they are found when they are asked for.
"""

from __future__ import annotations

import importlib
from types import ModuleType
from typing import Any, Final

__all__ = ["BORROWERS", "lend"]

_MESSAGES: Final = "FloatingPointRange IntegerRange ParameterDescriptor ParameterEvent ParameterType ParameterValue "
_STAMPED: Final = "PointStamped PoseStamped PoseWithCovarianceStamped TransformStamped Vector3Stamped WrenchStamped"
_ENTITIES: Final = "CallbackGroup Client Clock Context GuardCondition Service Subscription Timer Waitable "

BORROWERS: Final[dict[str, str]] = {  # by the module's name in ROS 2
    "rclpy.action.client": "CancelGoal GoalStatus Time UUID QoSProfile",
    "rclpy.action.server": "Future GoalInfo GoalStatus QoSProfile",
    "rclpy.client": "CallbackGroup Context Future QoSProfile",
    "rclpy.executors": _ENTITIES + "Future InvalidHandle NumberOfEntities Task get_default_context timeout_sec_to_nsec",
    "rclpy.node": _MESSAGES
    + _ENTITIES
    + "Executor InvalidParameterException InvalidParameterTypeException InvalidParameterValueException "
    "InvalidTopicNameException ListParametersResult LoggingService MutuallyExclusiveCallbackGroup "
    "NotInitializedException PARAMETER_SEPARATOR_STRING Parameter ParameterAlreadyDeclaredException "
    "ParameterImmutableException ParameterMsg ParameterNotDeclaredException ParameterService "
    "ParameterUninitializedException Publisher PublisherEventCallbacks QoSOverridingOptions QoSProfile ROSClock Rate "
    "ReentrantCallbackGroup SetParametersResult SubscriptionEventCallbacks S_TO_NS TimeSource TopicEndpointInfo "
    "expand_topic_name get_default_context get_logger qos_profile_parameter_events qos_profile_services_default "
    "validate_full_topic_name validate_namespace validate_node_name validate_parameter_name validate_topic_name",
    "rclpy.parameter": "ParameterDescriptor ParameterMsg ParameterType ParameterValue",
    "rclpy.publisher": "CallbackGroup Duration PublisherEventCallbacks QoSProfile",
    "rclpy.qos": "Duration",
    "rclpy.service": "CallbackGroup QoSProfile",
    "rclpy.subscription": "CallbackGroup QoSProfile SubscriptionEventCallbacks",
    "rclpy.time": "Duration",
    "rclpy.time_source": "Clock ROSClock",
    "rclpy.timer": "CallbackGroup Clock Context",
    "sensor_msgs_py.point_cloud2": "Header PointCloud2 PointField",
    "tf2_geometry_msgs": _STAMPED,
    "tf2_geometry_msgs.tf2_geometry_msgs": _STAMPED,
}

_LENDERS: Final[dict[str, str]] = {  # modules below metaros.ros2.rclpy
    "core.client": "Client",
    "core.context": "Context",
    "core.endpoint_info": "TopicEndpointInfo",
    "core.publisher": "Publisher",
    "core.rcl_errors": "InvalidHandle",
    "core.service": "Service",
    "core.subscription": "Subscription",
    "core.utilities": "get_default_context timeout_sec_to_nsec",
    "execution.callback_groups": "CallbackGroup MutuallyExclusiveCallbackGroup ReentrantCallbackGroup",
    "execution.executors": "Executor",
    "execution.guard_condition": "GuardCondition",
    "execution.task": "Future Task",
    "execution.waitable": "NumberOfEntities Waitable",
    "logging.loggers": "get_logger",
    "logging.logging_service": "LoggingService",
    "names.constants": "S_TO_NS",
    "names.exceptions": "InvalidParameterException InvalidParameterTypeException InvalidParameterValueException "
    "InvalidTopicNameException NotInitializedException ParameterAlreadyDeclaredException "
    "ParameterImmutableException ParameterNotDeclaredException ParameterUninitializedException",
    "names.expand_topic_name": "expand_topic_name",
    "names.validate_full_topic_name": "validate_full_topic_name",
    "names.validate_namespace": "validate_namespace",
    "names.validate_node_name": "validate_node_name",
    "names.validate_parameter_name": "validate_parameter_name",
    "names.validate_topic_name": "validate_topic_name",
    "parameters.parameter": "PARAMETER_SEPARATOR_STRING Parameter",
    "parameters.parameter_service": "ParameterService",
    "qos.event_handler": "PublisherEventCallbacks SubscriptionEventCallbacks",
    "qos.profile": "QoSProfile qos_profile_parameter_events qos_profile_services_default",
    "qos.qos_overriding_options": "QoSOverridingOptions",
    "time.clock": "Clock ROSClock",
    "time.duration": "Duration",
    "time.time_source": "TimeSource",
    "time.timer": "Rate Timer",
}
_INTERFACES: Final[dict[str, str]] = {
    "action_msgs/msg": "GoalInfo GoalStatus",
    "action_msgs/srv": "CancelGoal",
    "builtin_interfaces/msg": "Time",
    "geometry_msgs/msg": _STAMPED,
    "rcl_interfaces/msg": _MESSAGES + "ListParametersResult SetParametersResult",
    "sensor_msgs/msg": "PointCloud2 PointField",
    "std_msgs/msg": "Header",
    "unique_identifier_msgs/msg": "UUID",
}
_RENAMED: Final = {"ParameterMsg": "rcl_interfaces/msg/Parameter"}


def lend(name: str, module: ModuleType) -> None:
    """Let `module`, which ROS 2 calls `name`, find what it would import there. Its own names come first."""
    names = BORROWERS.get(name, "").split()
    if not names or getattr(module, "__getattr__", None) in _lent:
        return
    own: Any = module.__dict__.get("__getattr__")

    def find(wanted: str) -> Any:
        if wanted in names:
            return _find(wanted)
        if own is not None:
            return own(wanted)
        raise AttributeError(f"module {name!r} has no attribute {wanted!r}")

    _lent.append(find)
    module.__dict__["__getattr__"] = find


_lent: list[Any] = []


def _find(name: str) -> Any:
    for home, names in _LENDERS.items():
        if name in names.split():
            return getattr(importlib.import_module(f"metaros.ros2.rclpy.{home}"), name)
    from metaros.ros2.rosidl.catalogue import interface

    kinds = (f"{kind}/{name}" for kind, names in _INTERFACES.items() if name in names.split())
    return interface(_RENAMED.get(name) or next(kinds))
