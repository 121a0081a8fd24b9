"""`rclpy.parameter_client`: another node's parameters, by futures."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

from metaros.ros2.rclpy.parameters.value import Parameter
from metaros.ros2.rclpy.parameters.yaml_files import parameter_dict_from_yaml_file
from metaros.ros2.rosidl.catalogue import interface

__all__ = ["AsyncParameterClient"]

Callback = Callable[[Any], object] | None
_SERVICES = (
    "GetParameters",
    "ListParameters",
    "SetParameters",
    "GetParameterTypes",
    "DescribeParameters",
    "SetParametersAtomically",
)


class AsyncParameterClient:
    """Calls the six parameter services of the node `remote_node_name`. Somebody has to spin `node`.

    Each method returns a future of the response; `callback(future)` is called when it is done. `qos_profile` and
    `callback_group` are those of the clients.
    """

    def __init__(self, node: Any, remote_node_name: str, qos_profile: Any = None, callback_group: Any = None) -> None:
        self.remote_node_name = remote_node_name
        self.node = node
        options = {"callback_group": callback_group} | ({} if qos_profile is None else {"qos_profile": qos_profile})
        self._clients = {
            name: node.create_client(
                interface(f"rcl_interfaces/srv/{name}"), f"{remote_node_name}/{_snake(name)}", **options
            )
            for name in _SERVICES
        }

    def services_are_ready(self) -> bool:
        """Whether all six services are there."""
        return all(client.service_is_ready() for client in self._clients.values())

    def wait_for_services(self, timeout_sec: float | None = None) -> bool:
        """Wait until all six are there, without a time for as long as it takes; False when they are not in time."""
        clock = self.node.handle.context.clock
        end_s = math.inf if timeout_sec is None else clock.monotonic_s() + timeout_sec
        for client in self._clients.values():
            left_s = None if timeout_sec is None else max(0.0, end_s - clock.monotonic_s())
            if not client.wait_for_service(timeout_sec=left_s):
                return False
        return True

    def list_parameters(
        self, prefixes: list[str] | None = None, depth: int | None = None, callback: Callback = None
    ) -> Any:
        """Names below the prefixes, at most `depth` levels deep: a ListParameters.Response."""
        return self._call("ListParameters", callback, prefixes=prefixes or [], depth=depth or 0)

    def get_parameters(self, names: list[str], callback: Callback = None) -> Any:
        """Values: a GetParameters.Response."""
        return self._call("GetParameters", callback, names=names)

    def set_parameters(self, parameters: Sequence[Any], callback: Callback = None) -> Any:
        """Set each for itself, `Parameter` or message: a SetParameters.Response."""
        return self._call("SetParameters", callback, parameters=_messages(parameters))

    def describe_parameters(self, names: list[str], callback: Callback = None) -> Any:
        """Descriptors: a DescribeParameters.Response."""
        return self._call("DescribeParameters", callback, names=names)

    def get_parameter_types(self, names: list[str], callback: Callback = None) -> Any:
        """Types: a GetParameterTypes.Response."""
        return self._call("GetParameterTypes", callback, names=names)

    def set_parameters_atomically(self, parameters: Sequence[Any], callback: Callback = None) -> Any:
        """Set all or none, `Parameter` or message: a SetParametersAtomically.Response."""
        return self._call("SetParametersAtomically", callback, parameters=_messages(parameters))

    def delete_parameters(self, names: list[str], callback: Callback = None) -> Any:
        """Remove parameters, which only dynamically typed ones take: a SetParameters.Response."""
        return self.set_parameters([Parameter(name) for name in names], callback)

    def load_parameter_file(self, parameter_file: str, use_wildcard: bool = False, callback: Callback = None) -> Any:
        """Set what a parameter file has for any node, each for itself: a SetParameters.Response."""
        parameters = parameter_dict_from_yaml_file(parameter_file, use_wildcard)
        return self.set_parameters(list(parameters.values()), callback)

    def load_parameter_file_atomically(
        self, parameter_file: str, use_wildcard: bool = False, callback: Callback = None
    ) -> Any:
        """The same, all or none: a SetParametersAtomically.Response."""
        parameters = parameter_dict_from_yaml_file(parameter_file, use_wildcard)
        return self.set_parameters_atomically(list(parameters.values()), callback)

    def on_parameter_event(
        self,
        callback: Callable[..., object],
        qos_profile: Any = None,
        *,
        callback_group: Any = None,
        event_callbacks: Any = None,
        qos_overriding_options: Any = None,
        raw: bool = False,
    ) -> Any:
        """Subscribe to what happens to parameters, of all nodes: each a rcl_interfaces/msg/ParameterEvent."""
        from metaros.ros2.rclpy.qos.profile import qos_profile_parameter_events

        return self.node.create_subscription(
            interface("rcl_interfaces/msg/ParameterEvent"),
            "/parameter_events",
            callback,
            qos_profile_parameter_events if qos_profile is None else qos_profile,
            callback_group=callback_group,
            event_callbacks=event_callbacks,
            qos_overriding_options=qos_overriding_options,
            raw=raw,
        )

    def _call(self, service: str, callback: Callback, **fields: Any) -> Any:
        request = interface(f"rcl_interfaces/srv/{service}").Request(**fields)
        future = self._clients[service].call_async(request)
        if callback is not None:
            future.add_done_callback(callback)
        return future


def _snake(name: str) -> str:
    return "".join(f"_{letter.lower()}" if letter.isupper() else letter for letter in name)[1:]


def _messages(parameters: Sequence[Any]) -> list[Any]:
    return [item.to_parameter_msg() if isinstance(item, Parameter) else item for item in parameters]
