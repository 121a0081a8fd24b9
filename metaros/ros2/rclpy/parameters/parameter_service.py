"""`rclpy.parameter_service`: the six services by which others read and set a node's parameters."""

from __future__ import annotations

import weakref
from collections.abc import Sequence
from typing import Any

from metaros.node.parameters import PARAMETER_SERVICES
from metaros.node.standard_services import serve
from metaros.ros2.rclpy.names.exceptions import ParameterNotDeclaredException, ParameterUninitializedException
from metaros.ros2.rclpy.parameters.conversion import from_wire, to_wire
from metaros.ros2.rclpy.parameters.value import Parameter
from metaros.ros2.rosidl.catalogue import interface
from metaros.wire import qos_parameters

__all__ = ["ParameterService"]


class ParameterService:
    """Serves the parameters of an rclpy node, in its default callback group. As there, one unknown name empties an
    answer about several."""

    def __init__(self, node: Any) -> None:
        self._node = weakref.ref(node)
        for service in PARAMETER_SERVICES:
            callback = getattr(self, f"_{service.name}")
            serve(node.handle, service, callback, qos_parameters, group=node.default_callback_group)

    def _describe_parameters(self, request: Any, response: Any) -> None:
        try:
            response.descriptors = self._get_node().describe_parameters(request.names)
        except ParameterNotDeclaredException:
            return

    def _get_parameters(self, request: Any, response: Any) -> None:
        try:
            response.values = [to_wire(parameter) for parameter in self._get_node().get_parameters(request.names)]
        except (ParameterNotDeclaredException, ParameterUninitializedException):
            return

    def _get_parameter_types(self, request: Any, response: Any) -> None:
        unset = Parameter.Type.NOT_SET
        try:
            types = self._get_node().get_parameter_types(request.names)
        except ParameterNotDeclaredException:
            return
        response.types = [unset.value if kind is unset else kind for kind in types]

    def _list_parameters(self, request: Any, response: Any) -> None:
        response.result = self._get_node().list_parameters(list(request.prefixes), int(request.depth))

    def _set_parameters(self, request: Any, response: Any) -> None:
        response.results = [self._set([parameter]) for parameter in request.parameters]

    def _set_parameters_atomically(self, request: Any, response: Any) -> None:
        response.result = self._set(request.parameters)

    def _set(self, messages: Sequence[Any]) -> Any:
        try:
            return self._get_node().set_parameters_atomically([from_wire(message) for message in messages])
        except (ParameterNotDeclaredException, ValueError) as error:  # a type that no release knows
            return interface("rcl_interfaces/msg/SetParametersResult")(successful=False, reason=str(error))

    def _get_node(self) -> Any:
        node = self._node()
        if node is None:
            raise ReferenceError("the node of these parameters is gone")
        return node
