"""`rclpy.impl.implementation_singleton`: what Python code most often asks of rclpy's C extension.

There is none here. Errors and a few functions are what programs catch and call; everything else of it is no API.
"""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Final

from metaros.cdr import codec
from metaros.ros2.rclpy.core import rcl_errors, utilities
from metaros.ros2.rclpy.core.context import ContextHandle
from metaros.ros2.rclpy.core.handles import NodeHandle, PublisherHandle, SubscriptionHandle
from metaros.ros2.rclpy.core.service_handles import ClientHandle, ServiceHandle
from metaros.ros2.rclpy.core.service_introspection import ServiceIntrospectionState
from metaros.ros2.rclpy.core.signals import SignalHandlerOptions
from metaros.ros2.rclpy.qos import profile

__all__ = ["rclpy_implementation"]


def _remove_ros_args(args: Sequence[str] | None = None) -> list[str]:
    return utilities.remove_ros_args(args)


def _serialize(message: object, message_type: type) -> bytes:
    return codec(message_type).encode(message)


def _deserialize(data: bytes, message_type: type) -> object:
    return codec(message_type).decode(data)


def _predefined(name: str) -> object:
    """What stands for C's profile: it has `to_dict()`."""
    return getattr(profile, name).get_c_qos_profile()


rclpy_implementation: Final = SimpleNamespace(
    **{name: getattr(rcl_errors, name) for name in rcl_errors.__all__},
    RCL_DEFAULT_DOMAIN_ID=(1 << 64) - 1,
    Client=ClientHandle,
    Context=ContextHandle,
    Node=NodeHandle,
    Publisher=PublisherHandle,
    Service=ServiceHandle,
    SignalHandlerOptions=SignalHandlerOptions,
    Subscription=SubscriptionHandle,
    rclpy_deserialize=_deserialize,
    rclpy_get_rmw_implementation_identifier=utilities.get_rmw_implementation_identifier,
    rclpy_remove_ros_args=_remove_ros_args,
    rclpy_serialize=_serialize,
    rmw_qos_profile_t=SimpleNamespace(predefined=_predefined),
    service_introspection=SimpleNamespace(ServiceIntrospectionState=ServiceIntrospectionState),
)
