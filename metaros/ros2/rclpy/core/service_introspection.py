"""`rclpy.service_introspection`: clients and servers tell of their calls on `<service>/_service_event`."""

from __future__ import annotations

from enum import IntEnum
from typing import Any, Final

from metaros.errors import ClosedError
from metaros.ros2.rclpy.core.handles import PublisherHandle, Resolved
from metaros.ros2.rclpy.qos.conversion import to_native
from metaros.ros2.rclpy.qos.profile import QoSProfile
from metaros.ros2.rosidl.catalogue import interface

__all__ = ["Introspection", "ServiceIntrospectionState"]

REQUEST_SENT: Final = 0
REQUEST_RECEIVED: Final = 1
RESPONSE_SENT: Final = 2
RESPONSE_RECEIVED: Final = 3


class ServiceIntrospectionState(IntEnum):
    """How much is told: nothing, who called when, or the request and the response as well."""

    OFF = 0
    METADATA = 1
    CONTENTS = 2


class Introspection:
    """What one client or server tells. Off until it is configured."""

    def __init__(self, node: Any, service_type: type[Any], service_name: str) -> None:
        self._node, self._type, self._name = node, service_type, service_name
        self._state = ServiceIntrospectionState.OFF
        self._clock: Any = None
        self._publisher: PublisherHandle | None = None

    @property
    def on(self) -> bool:
        """Whether anything is told."""
        return self._publisher is not None

    def configure(self, clock: Any, qos: QoSProfile, state: ServiceIntrospectionState) -> None:
        """Tell so much from now on, stamped by `clock`, published with `qos`."""
        self.close()
        self._state, self._clock = ServiceIntrospectionState(state), clock
        if self._state is not ServiceIntrospectionState.OFF:
            topic = Resolved(f"{self._name}/_service_event")
            self._publisher = PublisherHandle(self._node, self._type.Event, topic, to_native(qos, publishes=True))

    def close(self) -> None:
        """Tell nothing more."""
        publisher, self._publisher = self._publisher, None
        if publisher is not None:
            publisher.close()

    def tell(self, what: int, gid: bytes, seq: int, *, request: Any = None, response: Any = None) -> None:
        """One step of one call, `what` being one of the four."""
        publisher = self._publisher
        if publisher is None:
            return
        info = interface("service_msgs/msg/ServiceEventInfo")()
        info.event_type, info.sequence_number = what, seq
        info.stamp = self._clock.now().to_msg()
        info.client_gid = list(gid)
        event = self._type.Event()
        event.info = info
        if self._state is ServiceIntrospectionState.CONTENTS:
            if request is not None:
                event.request = [request]
            if response is not None:
                event.response = [response]
        try:
            publisher.publish(event)
        except ClosedError:  # the node was destroyed meanwhile
            return
