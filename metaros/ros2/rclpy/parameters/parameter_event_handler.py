"""`rclpy.parameter_event_handler`: callbacks for what happens to parameters, of one node or of all."""

from __future__ import annotations

import threading
from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from itertools import chain
from typing import Any

from metaros.ros2.rosidl.catalogue import interface

__all__ = ["ParameterCallbackHandle", "ParameterEventCallbackHandle", "ParameterEventHandler"]

Callback = Callable[[Any], object]


class ParameterCallbackHandle:
    """A callback of one parameter of one node, to be removed by."""

    def __init__(self, parameter_name: str, node_name: str, callback: Callback) -> None:
        self.parameter_name = parameter_name
        self.node_name = node_name
        self.callback = callback
        self.mutex = threading.RLock()  # held while the callback runs


class ParameterEventCallbackHandle:
    """A callback of all events, to be removed by."""

    def __init__(self, callback: Callback) -> None:
        self.callback = callback
        self.mutex = threading.RLock()


class _Callbacks:
    """The callbacks of a handler. They may add and remove callbacks themselves."""

    def __init__(self) -> None:
        self.parameter_callbacks: dict[tuple[str, str], list[ParameterCallbackHandle]] = defaultdict(list)
        self.event_callbacks: list[ParameterEventCallbackHandle] = []
        self.mutex = threading.RLock()
        self.nodes: frozenset[str] = frozenset()  # whose events count; without names all do

    def event_callback(self, event: Any) -> None:
        """An event came: call who asked for it, those of single parameters first, the latest of them first."""
        if self.nodes and event.node not in self.nodes:
            return
        with self.mutex:
            by_parameter = [(key, list(handles)) for key, handles in self.parameter_callbacks.items()]
            of_all = list(self.event_callbacks)
        for (parameter_name, node_name), handles in by_parameter:
            parameter = ParameterEventHandler.get_parameter_from_event(event, parameter_name, node_name)
            for handle in handles if parameter is not None else ():
                with handle.mutex:
                    handle.callback(parameter)
        for any_handle in of_all:
            with any_handle.mutex:
                any_handle.callback(event)

    def add_parameter_callback(
        self, parameter_name: str, node_name: str, callback: Callback
    ) -> ParameterCallbackHandle:
        """Call it for this parameter of the node with this full name, before those that were added earlier."""
        handle = ParameterCallbackHandle(parameter_name, node_name, callback)
        with self.mutex:
            self.parameter_callbacks[parameter_name, node_name].insert(0, handle)
        return handle

    def remove_parameter_callback(self, handle: ParameterCallbackHandle) -> None:
        """Call it no more; RuntimeError where it is not there."""
        key = (handle.parameter_name, handle.node_name)
        with self.mutex:
            handles = self.parameter_callbacks.get(key, [])
            if handle not in handles:
                raise RuntimeError(f"Callback doesn't exist: that of {key[0]} of {key[1]} was removed before")
            handles.remove(handle)
            if not handles:
                del self.parameter_callbacks[key]

    def add_parameter_event_callback(self, callback: Callback) -> ParameterEventCallbackHandle:
        """Call it for all events, before those that were added earlier."""
        handle = ParameterEventCallbackHandle(callback)
        with self.mutex:
            self.event_callbacks.insert(0, handle)
        return handle

    def remove_parameter_event_callback(self, handle: ParameterEventCallbackHandle) -> None:
        """Call it no more; RuntimeError where it is not there."""
        with self.mutex:
            if handle not in self.event_callbacks:
                raise RuntimeError("Callback doesn't exist: it was removed before")
            self.event_callbacks.remove(handle)


class ParameterEventHandler:
    """Hears /parameter_events on a node that somebody spins. Options are those of its subscription."""

    Callbacks = _Callbacks

    def __init__(
        self,
        node: Any,
        qos_profile: Any = None,
        callback_group: Any = None,
        event_callbacks: Any = None,
        qos_overriding_options: Any = None,
        raw: bool = False,
    ) -> None:
        from metaros.ros2.rclpy.qos.profile import qos_profile_parameter_events

        self.node = node
        self.qos_profile = qos_profile_parameter_events if qos_profile is None else qos_profile
        self._callbacks = _Callbacks()
        self.parameter_event_subscription = node.create_subscription(
            interface("rcl_interfaces/msg/ParameterEvent"),
            "/parameter_events",
            self._callbacks.event_callback,
            self.qos_profile,
            callback_group=callback_group,
            event_callbacks=event_callbacks,
            qos_overriding_options=qos_overriding_options,
            raw=raw,
        )

    def destroy(self) -> None:
        """Hear no more."""
        self.node.destroy_subscription(self.parameter_event_subscription)

    @staticmethod
    def get_parameter_from_event(event: Any, parameter_name: str, node_name: str) -> Any:
        """The rcl_interfaces/msg/Parameter that came or changed by the event; None where it is of something else."""
        if event.node != node_name:
            return None
        parameters = ParameterEventHandler.get_parameters_from_event(event)
        return next((parameter for parameter in parameters if parameter.name == parameter_name), None)

    @staticmethod
    def get_parameters_from_event(event: Any) -> Iterable[Any]:
        """Each rcl_interfaces/msg/Parameter that came or changed by the event."""
        return chain(event.new_parameters, event.changed_parameters)

    def add_parameter_callback(
        self, parameter_name: str, node_name: str, callback: Callback
    ) -> ParameterCallbackHandle:
        """`callback(parameter)` when this parameter of the node came or changed; the one added last is called first.

        A `node_name` without a slash before it is in the namespace of the handler's node; "" is that node itself.
        """
        return self._callbacks.add_parameter_callback(parameter_name, self._resolve_path(node_name), callback)

    def remove_parameter_callback(self, handle: ParameterCallbackHandle) -> None:
        """Call it no more; RuntimeError where it is not there."""
        self._callbacks.remove_parameter_callback(handle)

    def add_parameter_event_callback(self, callback: Callback) -> ParameterEventCallbackHandle:
        """`callback(event)` for each rcl_interfaces/msg/ParameterEvent; the one added last is called first."""
        return self._callbacks.add_parameter_event_callback(callback)

    def remove_parameter_event_callback(self, handle: ParameterEventCallbackHandle) -> None:
        """Call it no more; RuntimeError where it is not there."""
        self._callbacks.remove_parameter_event_callback(handle)

    def configure_nodes_filter(self, node_names: Sequence[str] | None = None) -> bool:
        """Count only events of these nodes, by their full names; without names all. True: it holds from now on.

        Other nodes' events still cross the network: they are dropped here.
        """
        self._callbacks.nodes = frozenset(node_names or ())
        return True

    def _resolve_path(self, node_path: str | None = None) -> str:
        """A node's full name."""
        if not node_path:
            return str(self.node.get_fully_qualified_name())
        if node_path.startswith("/"):
            return node_path
        return f"{self.node.get_namespace().rstrip('/')}/{node_path}"
