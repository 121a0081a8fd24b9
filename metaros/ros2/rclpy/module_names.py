"""Where each module of rclpy is in this package: `rclpy.qos` is `metaros.ros2.rclpy.qos.profile`."""

from __future__ import annotations

from typing import Final

__all__ = ["HOMES"]

HOMES: Final[dict[str, str]] = {
    "client": "core.client",
    "constants": "names.constants",
    "context": "core.context",
    "destroyable": "core.destroyable",
    "event_handler": "qos.event_handler",
    "exceptions": "names.exceptions",
    "expand_topic_name": "names.expand_topic_name",
    "handle": "core.handle",
    "impl": "core.impl",
    "impl.implementation_singleton": "core.implementation_singleton",
    "lifecycle": "lifecycle",
    "node": "core.node",
    "parameter": "parameters.parameter",
    "parameter_client": "parameters.parameter_client",
    "parameter_event_handler": "parameters.parameter_event_handler",
    "parameter_service": "parameters.parameter_service",
    "publisher": "core.publisher",
    "qos": "qos.profile",
    "qos_event": "qos.qos_event",
    "qos_overriding_options": "qos.qos_overriding_options",
    "service": "core.service",
    "service_introspection": "core.service_introspection",
    "signals": "core.signals",
    "subscription": "core.subscription",
    "topic_or_service_is_hidden": "names.topic_or_service_is_hidden",
    "type_hash": "names.type_hash",
    "utilities": "core.utilities",
    "validate_full_topic_name": "names.validate_full_topic_name",
    "validate_namespace": "names.validate_namespace",
    "validate_node_name": "names.validate_node_name",
    "validate_parameter_name": "names.validate_parameter_name",
    "validate_topic_name": "names.validate_topic_name",
    "wait_for_message": "core.wait_for_message",
}
