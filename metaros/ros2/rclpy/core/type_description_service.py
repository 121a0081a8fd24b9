"""`rclpy.type_description_service`: the definitions of types, for who lacks them."""

from __future__ import annotations

from typing import Any, Final

from metaros.node.introspection import offer_type_description
from metaros.ros2.rosidl.catalogue import interface

__all__ = ["START_TYPE_DESCRIPTION_SERVICE_PARAM", "TypeDescriptionService"]

START_TYPE_DESCRIPTION_SERVICE_PARAM: Final = "start_type_description_service"


class TypeDescriptionService:
    """Serves `~/get_type_description` of an rclpy node, unless its parameter `start_type_description_service` is false.

    The parameter is read-only: it says at the start what it says.
    """

    def __init__(self, node: Any) -> None:
        if not node.has_parameter(START_TYPE_DESCRIPTION_SERVICE_PARAM):
            descriptor = interface("rcl_interfaces/msg/ParameterDescriptor")()
            descriptor.description = "Whether the node serves the definitions of types, as ~/get_type_description"
            descriptor.read_only = True
            node.declare_parameter(START_TYPE_DESCRIPTION_SERVICE_PARAM, True, descriptor)
        self.enabled = bool(node.get_parameter(START_TYPE_DESCRIPTION_SERVICE_PARAM).value)
        self._service = offer_type_description(node.handle) if self.enabled else None

    def destroy(self) -> None:
        """Serve no more."""
        if self._service is not None:
            self._service.close()
            self._service = None
