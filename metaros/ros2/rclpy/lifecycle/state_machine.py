"""Where a lifecycle node is, as rclpy's C extension tells it: plain tuples."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from metaros.node.lifecycle.interface import Lifecycle
from metaros.node.lifecycle.state_machine import STATES, TRANSITIONS, Transition

__all__ = ["LifecycleStateMachine"]

Described = tuple[int, str, int, str, int, str]


class LifecycleStateMachine:
    """`node._state_machine`, to be read: the node's `trigger_…` methods move it."""

    initialized = True

    def __init__(self, lifecycle: Lifecycle) -> None:
        self._lifecycle = lifecycle

    @property
    def current_state(self) -> tuple[int, str]:
        """The number and the label."""
        return self._lifecycle.state.id, self._lifecycle.state.label

    @property
    def available_states(self) -> list[tuple[int, str]]:
        """All states that there are."""
        return [(state.id, state.label) for state in STATES]

    @property
    def available_transitions(self) -> list[Described]:
        """Those that start here: number and label of the transition, of its start and of its goal."""
        return _described(self._lifecycle.available())

    @property
    def transition_graph(self) -> list[Described]:
        """All of them."""
        return _described(TRANSITIONS)

    def __getattr__(self, name: str) -> Any:
        """`service_change_state` and the like: the service; None where the node does not offer it."""
        if not name.startswith("service_"):
            raise AttributeError(f"a lifecycle's state machine has no {name!r}")
        return self._lifecycle.services.get(name.removeprefix("service_"))


def _described(transitions: Iterable[Transition]) -> list[Described]:
    return [(t.id, t.label, t.start.id, t.start.label, t.goal.id, t.goal.label) for t in transitions]
