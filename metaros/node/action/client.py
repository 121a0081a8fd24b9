"""Action clients: send goals, receive feedback, wait for results, cancel."""

from __future__ import annotations

import logging
import threading
import uuid
from collections import deque
from collections.abc import Callable
from typing import Any, Final

from metaros.cdr import codec
from metaros.errors import FieldError, PeerError, PeerRestartedError, UnavailableError
from metaros.limits import LIMITS
from metaros.node.action.client_goal import ActionResult, ClientGoal
from metaros.node.action.goal import NO_ID, TERMINAL, CancelCode, GoalState
from metaros.node.action.types import ENDPOINTS, ActionTypes, id_of, ns_of
from metaros.node.client import DEFAULT_TIMEOUT_S, Client
from metaros.node.core import NodeCore
from metaros.node.info import takes
from metaros.node.pending_call import Reply
from metaros.node.subscription import Subscription
from metaros.wire import QoSProfile, qos_default, qos_services, qos_transient_local

__all__ = ["ActionClient"]

_log = logging.getLogger("metaros.node")
_ENDED: Final = 32  # goals whose feedback is still heard after their result
_SERVICES: Final = ("send_goal", "cancel_goal", "get_result")


class _Followed:
    """A goal whose end is not known yet: where its feedback goes, and its handle once it was accepted."""

    __slots__ = ("feedback", "handle", "status")

    def __init__(self, feedback: Callable[[Any], Any] | None) -> None:
        self.feedback = feedback
        self.status = GoalState.UNKNOWN
        self.handle: ClientGoal | None = None


class ActionClient:
    """Sends goals to the action server `name`. Feedback and status arrive while the node spins. Thread-safe."""

    def __init__(self, node: NodeCore, action: type[Any], name: str) -> None:
        self.node = node
        self.name = node.resolve(name)
        self.action = action
        self._types = types = ActionTypes(action)
        self._lock = threading.Lock()
        self._followed: dict[bytes, _Followed] = {}
        self._ended: deque[bytes] = deque(maxlen=_ENDED)  # of those, with a result
        clients = []
        for part in _SERVICES:
            service = getattr(types, part)
            clients.append(
                Client(node, service, self.name + ENDPOINTS[part], qos=qos_services, **types.coders(service))
            )
        self._send_goal, self._cancel_goal, self._get_result = clients
        feedback = self._subscribe("feedback", types.feedback, self._on_feedback, qos_default)
        status = self._subscribe("status", types.status, self._on_status, qos_transient_local)
        self._endpoints = (*clients, feedback, status)

    def _subscribe(
        self, part: str, message: type[Any], callback: Callable[[Any], None], qos: QoSProfile
    ) -> Subscription:
        coder, topic = codec(message), self.name + ENDPOINTS[part]
        return Subscription(
            self.node, topic, coder.name, coder.hash, qos, callback, decode=coder.decode, dedicated=False
        )

    def close(self) -> None:
        """Leave the graph; whoever waits gets a ClosedError. Goals go on."""
        for endpoint in reversed(self._endpoints):
            endpoint.close()

    def server_is_ready(self) -> bool:
        """Whether all services and topics of a server are in the graph."""
        graph = self.node.graph
        topics = all(graph.endpoints(self.name + ENDPOINTS[part], "MP") for part in ("feedback", "status"))
        return topics and all(
            client.service_is_ready() for client in (self._send_goal, self._cancel_goal, self._get_result)
        )

    def wait_for_server(self, timeout_s: float = DEFAULT_TIMEOUT_S) -> bool:
        """Wait until a server is there; False when none is in time."""
        return self.node.graph.wait_for(self.server_is_ready, timeout_s)

    # -- goals -----------------------------------------------------------------------------------------------------

    def send_goal(
        self,
        goal: Any,
        *,
        feedback: Callable[[Any], Any] | None = None,
        timeout_s: float = DEFAULT_TIMEOUT_S,
        goal_id: bytes | None = None,
    ) -> Reply[ClientGoal]:
        """Send a Goal message; `await` the handle, or `.wait()` for it. `feedback(message)` runs on the executor.

        `goal_id` is 16 random bytes unless given.
        """
        if not isinstance(goal, self.action.Goal):
            raise FieldError(
                f"{self.name} takes a Goal of {self._types.action.__metaros_name__}, not {type(goal).__name__}"
            )
        if feedback is not None:
            takes(feedback, 1)
        goal_id = uuid.uuid4().bytes if goal_id is None else goal_id
        request = self._types.send_goal.Request(goal_id=self._types.goal_id(goal_id), goal=goal)
        self._follow(goal_id, feedback)

        def convert(response: Any) -> ClientGoal:
            return self._answered(goal_id, response)

        try:
            return self._send_goal.begin(request, convert, timeout_s)
        except Exception:
            self._forget(goal_id)
            raise

    def cancel_goals(self, *, until_ns: int = 0, timeout_s: float = DEFAULT_TIMEOUT_S) -> Reply[list[bytes]]:
        """Cancel every goal of the server, whoever sent it, or those accepted until a time; gives their ids."""
        return self._cancel_goal.begin(
            self._cancel_request(NO_ID, until_ns),
            lambda response: [id_of(info.goal_id) for info in response.goals_canceling],
            timeout_s,
        )

    def cancel_goal(self, goal: ClientGoal, timeout_s: float) -> Reply[bool]:
        """What `goal.cancel` does."""

        def convert(response: Any) -> bool:
            if response.return_code == CancelCode.UNKNOWN_GOAL:
                raise self._unknown(goal)
            return any(id_of(info.goal_id) == goal.goal_id for info in response.goals_canceling)

        request = self._cancel_request(goal.goal_id, 0)
        return self._cancel_goal.begin(request, convert, timeout_s, lost=PeerRestartedError)

    def get_result(self, goal: ClientGoal, timeout_s: float | None) -> Reply[ActionResult]:
        """What `goal.result` does."""

        def convert(response: Any) -> ActionResult:
            status = _state(response.status)
            if status not in TERMINAL:
                raise self._unknown(goal)
            goal.learn(status)
            self._forget_soon(goal.goal_id)
            return ActionResult(status, response.result)

        request = self._types.get_result.Request(goal_id=self._types.goal_id(goal.goal_id))
        return self._get_result.begin(request, convert, timeout_s, lost=PeerRestartedError)

    def _unknown(self, goal: ClientGoal) -> UnavailableError:
        """A server that does not know a goal which it accepted, and whose end it never told, is another one."""
        text = f"the server of {self.name} does not know goal {goal.goal_id.hex()}"
        if goal.status in TERMINAL:
            return UnavailableError(f"{text} any more")
        return PeerRestartedError(f"{text}: it was restarted since")

    def _cancel_request(self, goal_id: bytes, stamp_ns: int) -> Any:
        return self._types.cancel_goal.Request(goal_info=self._types.info(goal_id, stamp_ns))

    def _answered(self, goal_id: bytes, response: Any) -> ClientGoal:
        handle = ClientGoal(self, goal_id, accepted=bool(response.accepted), stamp_ns=ns_of(response.stamp))
        with self._lock:
            followed = self._followed.get(goal_id)
            if followed is not None and handle.accepted:
                followed.handle = handle
                handle.learn(followed.status)  # the status topic may have been faster
        if not handle.accepted:
            self._forget(goal_id)
        return handle

    # -- what the server tells -------------------------------------------------------------------------------------

    def _follow(self, goal_id: bytes, feedback: Callable[[Any], Any] | None) -> None:
        """From before it is sent: feedback may overtake the answer."""
        with self._lock:
            if len(self._followed) >= LIMITS.action_goals:  # ends that nobody heard of: the node does not spin
                del self._followed[next(iter(self._followed))]
            self._followed[goal_id] = _Followed(feedback)

    def _forget_soon(self, goal_id: bytes) -> None:
        """When some more have ended: a result may overtake the last feedback, which is to be heard all the same."""
        with self._lock:
            if len(self._ended) == self._ended.maxlen:
                self._followed.pop(self._ended[0], None)
            self._ended.append(goal_id)

    def _forget(self, goal_id: bytes) -> None:
        with self._lock:
            self._followed.pop(goal_id, None)

    def _on_feedback(self, message: Any) -> None:
        followed = self._followed.get(id_of(message.goal_id))
        if followed is not None and followed.feedback is not None:
            followed.feedback(message.feedback)

    def _on_status(self, message: Any) -> None:
        for entry in message.status_list:
            goal_id, status = id_of(entry.goal_info.goal_id), _state(entry.status)
            followed = self._followed.get(goal_id)
            if followed is None:
                continue
            followed.status = status
            if followed.handle is not None:
                followed.handle.learn(status)


def _state(number: int) -> GoalState:
    try:
        return GoalState(number)
    except ValueError:
        raise PeerError(f"{number} is no goal status") from None
