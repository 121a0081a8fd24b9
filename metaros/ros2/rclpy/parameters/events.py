"""What happens to a node's parameters, on /parameter_events, as any node of this library tells it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

from metaros.cdr import codec
from metaros.node.core import NodeCore
from metaros.node.parameters.services import EVENT_HASH, EVENT_TYPE, EVENTS
from metaros.node.publisher import RawPublisher
from metaros.ros2.rclpy.core.handles import PublisherHandle
from metaros.ros2.rclpy.core.publisher import Publisher
from metaros.ros2.rclpy.core.rcl_errors import InvalidHandle, RCLError
from metaros.ros2.rclpy.parameters.conversion import to_wire
from metaros.ros2.rclpy.parameters.value import Parameter
from metaros.ros2.rclpy.qos.profile import qos_profile_parameter_events
from metaros.ros2.rosidl.catalogue import interface
from metaros.wire import qos_parameters

__all__ = ["ParameterEvents"]

Parameters = Sequence[Parameter[Any]]
_OWN: Final = frozenset({"use_sim_time", "start_type_description_service"})  # what every node declares as it starts


class _Handle(PublisherHandle):
    """A publisher whose codec is compiled with the first event: a node shall start quickly."""

    def __init__(self, node: NodeCore, message_type: type[Any]) -> None:
        self.event_handlers = []
        self.message_type = message_type
        options: Any = {"message_type": message_type, "encode": lambda message: codec(message_type).encode(message)}
        RawPublisher.__init__(self, node, EVENTS, EVENT_TYPE, EVENT_HASH, qos_parameters, **options)


class ParameterEvents:
    """Publishes the events of one node, stamped by its clock. `publisher` is one of the node's publishers."""

    def __init__(self, node: Any) -> None:
        message_type = interface(EVENT_TYPE)
        self._node = node.handle
        self._clock = node.get_clock()
        handle = _Handle(node.handle, message_type)
        self.publisher = Publisher(handle, message_type, EVENTS, qos_profile_parameter_events)

    def publish(self, new: Parameters, changed: Parameters, deleted: Parameters) -> None:
        """Tell what came, what has another value, and what went."""
        if new and _OWN.issuperset(parameter.name for parameter in new) and not self._heard():
            return  # the first event takes a while, and every node would begin with it
        from metaros.interfaces.builtin_interfaces.msg import Time
        from metaros.interfaces.rcl_interfaces.msg import ParameterEvent

        seconds, nanoseconds = divmod(self._clock.now().nanoseconds, 1_000_000_000)
        event = ParameterEvent(stamp=Time(sec=seconds, nanosec=nanoseconds), node=self._node.full_name)
        event.new_parameters, event.changed_parameters = _messages(new), _messages(changed)
        event.deleted_parameters = _messages(deleted)
        try:
            self.publisher.publish(codec(EVENT_TYPE).encode(event))
        except (InvalidHandle, RCLError):  # the parameters of a destroyed node are its own affair
            return

    def _heard(self) -> bool:
        return bool(self._node.graph.endpoints(EVENTS, "MS"))


def _messages(parameters: Parameters) -> list[Any]:
    from metaros.interfaces.rcl_interfaces.msg import Parameter as Message

    return [Message(name=parameter.name, value=to_wire(parameter)) for parameter in parameters]
