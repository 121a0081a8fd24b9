"""The wire side of an action server: three services and two topics, and what is told of the calls."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Mapping
from contextlib import suppress
from typing import Any

from metaros.errors import ClosedError, FieldError
from metaros.node.action.types import ActionTypes
from metaros.node.service import PendingRequest
from metaros.ros2.rclpy.core.handles import NodeHandle, PublisherHandle, Resolved
from metaros.ros2.rclpy.core.rcl_errors import InvalidHandle
from metaros.ros2.rclpy.core.service_handles import ServiceHandle
from metaros.ros2.rclpy.core.service_introspection import (
    REQUEST_RECEIVED,
    RESPONSE_SENT,
    Introspection,
    ServiceIntrospectionState,
)
from metaros.ros2.rclpy.qos.conversion import to_native
from metaros.ros2.rclpy.qos.profile import QoSProfile

__all__ = ["ServerEndpoints"]

Serve = Callable[[Any, PendingRequest], Awaitable[None] | None]


class ServerEndpoints:
    """All five, by the keys of their names; `serve` has the callbacks of the services, `qos` the profiles of all."""

    def __init__(
        self,
        node: NodeHandle,
        types: ActionTypes,
        names: Mapping[str, Resolved],
        *,
        serve: Mapping[str, Serve],
        qos: Mapping[str, QoSProfile],
        group: Any,
    ) -> None:
        self._node, self._types = node, types
        self._closed = False
        self._told: dict[str, Introspection] = {}
        self._services: dict[str, ServiceHandle] = {}
        for part, callback in serve.items():
            service = getattr(types, part)
            self._told[part] = Introspection(node, service, names[part])
            self._services[part] = ServiceHandle(node, service, names[part], callback, to_native(qos[part]), group)
        self._feedback, self._status = (
            PublisherHandle(node, getattr(types, part), names[part], to_native(qos[part], publishes=True))
            for part in ("feedback", "status")
        )

    def waiting(self, part: str) -> int:
        """Clients that wait for an answer of this service."""
        return self._services[part].waiting

    def asked(self, part: str, waiting: PendingRequest, request: Any) -> None:
        """A request came: tell of it, where that is configured."""
        if self._told[part].on:
            self._told[part].tell(REQUEST_RECEIVED, *waiting.key, request=request)

    def answer(self, part: str, waiting: PendingRequest, response: Any) -> None:
        """Send a response; FieldError where a value does not fit, which the client learns, too."""
        try:
            waiting.answer(response)
        except FieldError as error:
            waiting.refuse(f"{type(error).__name__}: {error}")
            raise
        if self._told[part].on:
            self._told[part].tell(RESPONSE_SENT, *waiting.key, response=response)

    def publish_feedback(self, goal_id: Any, feedback: Any) -> None:
        """How far a goal is."""
        self._publish(self._feedback, self._types.feedback(goal_id=goal_id, feedback=feedback))

    def publish_status(self, entries: list[Any]) -> None:
        """Where all goals are, each a GoalStatus."""
        self._publish(self._status, self._types.status(status_list=entries))

    def _publish(self, publisher: PublisherHandle, message: Any) -> None:
        try:
            publisher.publish(message)
        except ClosedError:
            if not (self._closed or self._node.closed):
                raise

    def configure_introspection(self, clock: Any, qos: QoSProfile, state: ServiceIntrospectionState) -> None:
        """Tell of the calls of all three services, or, with OFF, no more."""
        for told in self._told.values():
            told.configure(clock, qos, state)

    def close(self) -> None:
        """Leave the graph; clients that wait learn that nobody answers."""
        self._closed = True
        for told in self._told.values():
            told.close()
        for endpoint in (self._status, self._feedback, *reversed(self._services.values())):
            with suppress(InvalidHandle):
                endpoint.destroy_when_not_in_use()
