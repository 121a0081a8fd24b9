"""`ActionClient`: sends goals, hears feedback and status, waits for results, cancels."""

from __future__ import annotations

import os
import threading
import weakref
from collections.abc import Callable
from contextlib import suppress
from types import GenericAlias
from typing import Any, Final, TypeVar

from metaros.limits import LIMITS
from metaros.node.action.goal import TERMINAL
from metaros.node.action.types import ActionTypes
from metaros.ros2.rclpy.action.client_goal import ClientGoalHandle
from metaros.ros2.rclpy.action.names import ActionNode, endpoint_names, uuid_bytes
from metaros.ros2.rclpy.action.result_client import ResultClient
from metaros.ros2.rclpy.core.client import Client
from metaros.ros2.rclpy.core.graph_wait import wait_in_graph
from metaros.ros2.rclpy.core.handles import SubscriptionHandle
from metaros.ros2.rclpy.core.rcl_errors import InvalidHandle, RCLError
from metaros.ros2.rclpy.core.service_handles import ClientHandle
from metaros.ros2.rclpy.core.service_introspection import ServiceIntrospectionState
from metaros.ros2.rclpy.execution.task import Future
from metaros.ros2.rclpy.execution.waitable import NumberOfEntities, Waitable
from metaros.ros2.rclpy.qos.conversion import to_native
from metaros.ros2.rclpy.qos.profile import (
    QoSProfile,
    qos_profile_action_status_default,
    qos_profile_services_default,
)

__all__ = ["ActionClient", "ClientGoalHandle"]

C = TypeVar("C", bound=Client)
_FEEDBACK_QOS: Final = QoSProfile(depth=10)


class ActionClient(Waitable[Any]):
    """Sends goals to the action `action_name`. Feedback, status and futures come while the node is spun."""

    __class_getitem__: Any = classmethod(GenericAlias)
    _by_mail = True  # executors need not ask it: what comes for it is in mailboxes of the node

    def __init__(
        self,
        node: ActionNode,
        action_type: type[Any],
        action_name: str,
        *,
        callback_group: Any = None,
        goal_service_qos_profile: QoSProfile = qos_profile_services_default,
        result_service_qos_profile: QoSProfile = qos_profile_services_default,
        cancel_service_qos_profile: QoSProfile = qos_profile_services_default,
        feedback_sub_qos_profile: QoSProfile = _FEEDBACK_QOS,
        status_sub_qos_profile: QoSProfile = qos_profile_action_status_default,
    ) -> None:
        names = endpoint_names(node, action_type, action_name)
        super().__init__(node.default_callback_group if callback_group is None else callback_group)
        self._node = node
        self._action_type = action_type
        self._action_name = action_name
        self._names = names
        self._types = ActionTypes(action_type)
        self._lock = threading.Lock()
        self._destroyed = False
        self._goal_handles: dict[bytes, weakref.ref[ClientGoalHandle]] = {}
        self._statuses: dict[bytes, int] = {}  # what the server last told: of a quick goal it may overtake the answer
        self._feedback_callbacks: dict[bytes, Callable[[Any], Any]] = {}
        handle, group = node.handle, self.callback_group

        def client(kind: type[C], part: str, service: type[Any], qos: QoSProfile) -> C:
            impl = ClientHandle(handle, service, names[part], to_native(qos))
            return kind(node.context, impl, service, names[part], qos, group)

        def subscription(part: str, message: type[Any], qos: QoSProfile, callback: Any) -> SubscriptionHandle:
            return SubscriptionHandle(handle, message, names[part], to_native(qos), callback, group=group)

        self._goal_client = client(Client, "send_goal", self._types.send_goal, goal_service_qos_profile)
        self._cancel_client = client(Client, "cancel_goal", self._types.cancel_goal, cancel_service_qos_profile)
        self._result_client = client(ResultClient, "get_result", self._types.get_result, result_service_qos_profile)
        self._clients = (self._goal_client, self._cancel_client, self._result_client)
        self._subscriptions = (
            subscription("feedback", self._types.feedback, feedback_sub_qos_profile, self._on_feedback),
            subscription("status", self._types.status, status_sub_qos_profile, self._on_status),
        )
        self._result_client.feedback = self._subscriptions[0]
        node.add_waitable(self)

    # -- goals -----------------------------------------------------------------------------------------------------

    def send_goal(self, goal: Any, **kwargs: Any) -> Any:
        """Send a Goal message and wait for its end: a response with `status` and `result`. Not in callbacks.

        The arguments are those of `send_goal_async`. No executor has to spin for this, but for feedback.
        """
        request = self._goal_request(goal, **kwargs)
        return self._get_result(self._accepted(request, self._goal_client.call(request)))

    def send_goal_async(
        self, goal: Any, feedback_callback: Callable[[Any], Any] | None = None, goal_uuid: Any = None
    ) -> Future[Any]:
        """Send a Goal message; a future of the ClientGoalHandle.

        `feedback_callback(message)`, plain or `async def`, gets messages with `goal_id` and `feedback`. `goal_uuid` is
        a UUID message, random unless given. TypeError where the goal is of another class.
        """
        request = self._goal_request(goal, feedback_callback, goal_uuid)
        future = Future[Any]()
        self._goal_client.call_async(request).add_done_callback(
            lambda sent: _pass_on(sent, future, lambda response: self._accepted(request, response))
        )
        return future

    def _goal_request(
        self, goal: Any, feedback_callback: Callable[[Any], Any] | None = None, goal_uuid: Any = None
    ) -> Any:
        """The request, its feedback followed from now on: that may overtake the answer."""
        if not isinstance(goal, self._action_type.Goal):
            raise TypeError(f"Expected {self._action_type.Goal}, got {type(goal)}")
        request = self._types.send_goal.Request()
        request.goal_id = self._generate_random_uuid() if goal_uuid is None else goal_uuid
        request.goal = goal
        if feedback_callback is not None:
            with self._lock:
                if len(self._feedback_callbacks) >= LIMITS.action_goals:  # of ends that nobody asked for
                    del self._feedback_callbacks[next(iter(self._feedback_callbacks))]
                self._feedback_callbacks[uuid_bytes(request.goal_id)] = feedback_callback
        return request

    def _generate_random_uuid(self) -> Any:
        random = bytearray(os.urandom(16))
        random[6], random[8] = random[6] & 0x0F | 0x40, random[8] & 0x3F | 0x80  # of version 4
        return self._types.uuid(uuid=list(random))

    def _accepted(self, request: Any, response: Any) -> ClientGoalHandle:
        """The server answered."""
        goal_handle = ClientGoalHandle(self, request.goal_id, response)
        goal_id = uuid_bytes(request.goal_id)
        if not goal_handle.accepted:
            self._feedback_callbacks.pop(goal_id, None)
            return goal_handle
        with self._lock:
            if goal_id in self._goal_handles:
                raise RuntimeError(f"Two goals were accepted with the same ID ({goal_handle})")
            goal_handle._status = self._statuses.get(goal_id, goal_handle.status)
            if goal_handle.status not in TERMINAL:
                self._goal_handles[goal_id] = weakref.ref(goal_handle)
        return goal_handle

    def _cancel_goal(self, goal_handle: ClientGoalHandle) -> Any:
        return self._cancel_client.call(self._cancel_request(goal_handle))

    def _cancel_goal_async(self, goal_handle: ClientGoalHandle) -> Future[Any]:
        return self._cancel_client.call_async(self._cancel_request(goal_handle))

    def _cancel_request(self, goal_handle: ClientGoalHandle) -> Any:
        _check(goal_handle)
        request = self._types.cancel_goal.Request()
        request.goal_info.goal_id = goal_handle.goal_id
        return request

    def _get_result(self, goal_handle: ClientGoalHandle) -> Any:
        return self._result_client.call(self._result_request(goal_handle))

    def _get_result_async(self, goal_handle: ClientGoalHandle) -> Future[Any]:
        future = self._result_client.call_async(self._result_request(goal_handle))
        goal_id = uuid_bytes(goal_handle.goal_id)
        future.add_done_callback(lambda _: self._feedback_callbacks.pop(goal_id, None))
        return future

    def _result_request(self, goal_handle: ClientGoalHandle) -> Any:
        _check(goal_handle)
        request = self._types.get_result.Request()
        request.goal_id = goal_handle.goal_id
        return request

    # -- what the server tells -------------------------------------------------------------------------------------

    def _on_feedback(self, message: Any) -> Any:
        callback = self._feedback_callbacks.get(uuid_bytes(message.goal_id))
        return None if callback is None else callback(message)

    def _on_status(self, message: Any) -> None:
        statuses = {uuid_bytes(entry.goal_info.goal_id): entry.status for entry in message.status_list}
        with self._lock:
            self._statuses = statuses
            for goal_id, status in statuses.items():
                reference = self._goal_handles.get(goal_id)
                if reference is None:
                    continue
                goal_handle = reference()
                if goal_handle is not None:
                    goal_handle._status = status
                if goal_handle is None or status in TERMINAL:
                    del self._goal_handles[goal_id]

    # -- the server ------------------------------------------------------------------------------------------------

    def server_is_ready(self) -> bool:
        """Whether all services and topics of a server are in the graph."""
        graph = self._node.handle.graph
        topics = all(graph.endpoints(self._names[part], "MP") for part in ("feedback", "status"))
        return topics and all(client.service_is_ready() for client in self._clients)

    def wait_for_server(self, timeout_sec: float | None = None) -> bool:
        """Wait for a server, without a `timeout_sec` for ever; whether one is there.

        RCLError where the context is shut down: a loop around this would never end.
        """
        alive = self._node.context.ok
        ready = wait_in_graph(self._node.handle.graph, self.server_is_ready, timeout_sec, alive)
        if not ready and not alive():
            raise RCLError(f"there is no telling whether {self._action_name} is served: the context is shut down")
        return ready

    def configure_introspection(
        self, clock: Any, service_event_qos_profile: QoSProfile, introspection_state: ServiceIntrospectionState
    ) -> None:
        """Tell of each call of the three services on `<service>/_service_event`, or, with OFF, no more."""
        for client in self._clients:
            client.configure_introspection(clock, service_event_qos_profile, introspection_state)

    # -- as a waitable ---------------------------------------------------------------------------------------------

    def get_num_entities(self) -> NumberOfEntities:
        """Three clients and two subscriptions."""
        return NumberOfEntities(num_subs=2, num_clients=3)

    def add_to_wait_set(self, wait_set: Any) -> None:
        """Nothing: what comes is in mailboxes of the node, which the executor knows."""

    def is_ready(self, wait_set: Any) -> bool:
        """Never, for the same reason."""
        return False

    def destroy(self) -> None:
        """Leave the graph; futures that are open stay so. Goals go on. Safe to call twice."""
        if self._destroyed:
            return
        self._destroyed = True
        for subscription in self._subscriptions:
            with suppress(InvalidHandle):
                subscription.destroy_when_not_in_use()
        for client in self._clients:
            with suppress(InvalidHandle):
                client.destroy()
        with suppress(ValueError):
            self._node.remove_waitable(self)


def _check(goal_handle: object) -> None:
    if not isinstance(goal_handle, ClientGoalHandle):
        raise TypeError(f"Expected type ClientGoalHandle but received {type(goal_handle)}")


def _pass_on(sent: Future[Any], future: Future[Any], convert: Callable[[Any], Any]) -> None:
    """What became of one future is what becomes of another."""
    if sent.cancelled() or future.cancelled():
        return
    error = sent.exception()
    try:
        if error is not None:
            raise error
        result = convert(sent.result())
    except Exception as failed:
        future.set_exception(failed)
    else:
        future.set_result(result)
