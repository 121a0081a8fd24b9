"""A node's lifecycle on the wire: the five standard services and `~/transition_event` around the machine."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from metaros.errors import ClosedError, UsageError
from metaros.executor import CallbackGroup
from metaros.interfaces.lifecycle_msgs import msg, srv
from metaros.node.lifecycle.hooks import Steps, ask, drive
from metaros.node.lifecycle.managed import Gate
from metaros.node.lifecycle.state_machine import STATES, TRANSITIONS, Result, State, StateMachine, Transition
from metaros.node.publisher import Publisher
from metaros.node.service import Service

if TYPE_CHECKING:
    from metaros.node.node import Node

__all__ = ["Lifecycle"]


class Lifecycle:
    """State machine, gate and services of one node. `on_transition` functions are called for every transition taken.

    `hooks` has the callbacks, and a `full_name` for the log; it is the node itself unless given. Unless `offered`
    nobody else sees the node's states. The callbacks of the services are of the `group`.
    """

    def __init__(
        self, node: Node, *, hooks: Any = None, offered: bool = True, group: CallbackGroup | None = None
    ) -> None:
        self._node = node
        self._hooks = node if hooks is None else hooks
        self._machine = StateMachine()
        self._requesting = threading.Lock()
        self.gate = Gate()
        self.on_transition: list[Callable[[Transition], object]] = []
        self.services: dict[str, Service] = {}
        self._events: Publisher | None = None
        if offered:
            self._offer(group)

    def _offer(self, group: CallbackGroup | None) -> None:
        self._events = self._node.create_publisher(msg.TransitionEvent, "~/transition_event")
        for kind, name, callback in (
            (srv.ChangeState, "change_state", self._on_change_state),
            (srv.GetState, "get_state", self._on_get_state),
            (srv.GetAvailableStates, "get_available_states", self._on_states),
            (srv.GetAvailableTransitions, "get_available_transitions", self._on_transitions),
            (srv.GetAvailableTransitions, "get_transition_graph", self._on_graph),
        ):
            self.services[name] = self._node.create_service(kind, f"~/{name}", callback, group=group)

    @property
    def state(self) -> State:
        """Where the node is."""
        return self._machine.state

    def available(self) -> tuple[Transition, ...]:
        """The transitions that start here, in the order in which ROS 2 lists them."""
        return self._machine.available()

    def can(self, wanted: int | str) -> bool:
        """Whether a transition is possible now."""
        return self._machine.find(wanted) is not None

    def change(self, wanted: int | str) -> Steps[Result]:
        """Take a transition with its callback; UsageError where it is not possible now."""
        with self._requesting:
            taken = self._machine.request(wanted)
        self._took(taken)
        result = yield from ask(self._hooks, f"on_{taken.label}", taken.start)
        self._took(self._machine.finish(result))
        if result is Result.ERROR:
            verdict = yield from ask(self._hooks, "on_error", taken.start, default=Result.FAILURE)
            self._took(self._machine.finish(verdict))
        return result

    def _took(self, transition: Transition) -> None:
        self.gate.entered(transition.goal)
        if self._events is not None:
            with suppress(ClosedError):  # a callback closed its node
                self._events.publish(
                    msg.TransitionEvent(
                        timestamp=self._node.clock.wall_ns(),
                        transition=msg.Transition(id=transition.id, label=transition.label),
                        start_state=_state(transition.start),
                        goal_state=_state(transition.goal),
                    )
                )
        for listener in self.on_transition:
            listener(transition)

    # -- services --------------------------------------------------------------------------------------------------

    def _on_change_state(self, request: srv.ChangeState_Request, response: srv.ChangeState_Response) -> Any:
        """The label counts before the number, which is 0 where somebody gives only a label."""
        return drive(self._changed(request.transition.label or request.transition.id, response))

    def _changed(self, wanted: int | str, response: srv.ChangeState_Response) -> Steps[Any]:
        try:
            result = yield from self.change(wanted)
        except UsageError as error:
            self._node.get_logger().warn(f"change_state refused: {error}")
            return response
        response.success = result is Result.SUCCESS
        return response

    def _on_get_state(self, _request: Any, response: srv.GetState_Response) -> None:
        response.current_state = _state(self.state)

    def _on_states(self, _request: Any, response: srv.GetAvailableStates_Response) -> None:
        response.available_states = [_state(state) for state in STATES]

    def _on_transitions(self, _request: Any, response: srv.GetAvailableTransitions_Response) -> None:
        response.available_transitions = _descriptions(self.available())

    def _on_graph(self, _request: Any, response: srv.GetAvailableTransitions_Response) -> None:
        response.available_transitions = _descriptions(TRANSITIONS)


def _state(state: State) -> msg.State:
    return msg.State(id=state.id, label=state.label)


def _descriptions(transitions: Iterable[Transition]) -> list[msg.TransitionDescription]:
    return [
        msg.TransitionDescription(
            transition=msg.Transition(id=transition.id, label=transition.label),
            start_state=_state(transition.start),
            goal_state=_state(transition.goal),
        )
        for transition in transitions
    ]
