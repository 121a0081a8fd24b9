"""`rclpy.logging_service`: the levels of this process's loggers, read and set by others."""

from __future__ import annotations

from typing import Any

from metaros.ros2.rclpy.logging.loggers import get_logger_level, set_logger_level
from metaros.ros2.rclpy.qos.profile import qos_profile_services_default
from metaros.ros2.rosidl.catalogue import interface

__all__ = ["LoggingService"]


class LoggingService:
    """Offers `get_logger_levels` and `set_logger_levels` below the name of an rclpy node, for any logger."""

    def __init__(self, node: Any) -> None:
        for name, callback in (("Get", self._get_logger_levels), ("Set", self._set_logger_levels)):
            service_type = interface(f"rcl_interfaces/srv/{name}LoggerLevels")
            service = f"{node.get_name()}/{name.lower()}_logger_levels"
            node.create_service(service_type, service, callback, qos_profile=qos_profile_services_default)

    def _get_logger_levels(self, request: Any, response: Any) -> Any:
        level_type = interface("rcl_interfaces/msg/LoggerLevel")
        response.levels = [level_type(name=name, level=int(get_logger_level(name))) for name in request.names]
        return response

    def _set_logger_levels(self, request: Any, response: Any) -> Any:
        result_type = interface("rcl_interfaces/msg/SetLoggerLevelsResult")
        results = []
        for wanted in request.levels:
            reason = ""
            try:
                set_logger_level(wanted.name, wanted.level, detailed_error=True)
            except ValueError:
                reason = "Failed reason: Invalid logger level."
            except RuntimeError as error:
                reason = str(error)
            results.append(result_type(successful=not reason, reason=reason))
        response.results = results
        return response
