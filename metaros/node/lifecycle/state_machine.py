"""The managed node of ROS 2 as a pure class over two tables: eleven states, twenty-five transitions.

A request (`configure`, `cleanup`, `activate`, `deactivate`, `shutdown`) leads from a primary state to a transition
state. There the node's callback runs, and its result leads on to a primary state or, on an error, to
`errorprocessing`, whose own callback decides between `unconfigured` and `finalized`.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Final

from metaros.errors import UsageError

__all__ = ["STATES", "TRANSITIONS", "Result", "State", "StateMachine", "Transition"]


class Result(Enum):
    """What a transition's callback came to."""

    SUCCESS = "success"
    FAILURE = "failure"  # it was not done, the node is as it was before
    ERROR = "error"  # it went wrong: the error callback has to clean up


@dataclass(frozen=True, slots=True)
class State:
    """A state under its number and label in lifecycle_msgs/msg/State."""

    id: int
    label: str

    @property
    def primary(self) -> bool:
        """Whether the node rests there; else a callback is running."""
        return self.id < 10


@dataclass(frozen=True, slots=True)
class Transition:
    """A transition under its number in lifecycle_msgs/msg/Transition and its label in rcl."""

    id: int
    label: str
    start: State
    goal: State

    @property
    def requested(self) -> bool:
        """Whether somebody asks for it; else a callback's result takes it."""
        return self.start.primary


UNKNOWN = State(0, "unknown")
UNCONFIGURED = State(1, "unconfigured")
INACTIVE = State(2, "inactive")
ACTIVE = State(3, "active")
FINALIZED = State(4, "finalized")
CONFIGURING = State(10, "configuring")
CLEANING_UP = State(11, "cleaningup")
SHUTTING_DOWN = State(12, "shuttingdown")
ACTIVATING = State(13, "activating")
DEACTIVATING = State(14, "deactivating")
ERROR_PROCESSING = State(15, "errorprocessing")

STATES: Final = (
    UNKNOWN,
    UNCONFIGURED,
    INACTIVE,
    ACTIVE,
    FINALIZED,
    CONFIGURING,
    CLEANING_UP,
    SHUTTING_DOWN,
    ACTIVATING,
    DEACTIVATING,
    ERROR_PROCESSING,
)

_OK, _NO, _BAD = "transition_success", "transition_failure", "transition_error"

TRANSITIONS: Final = (
    Transition(1, "configure", UNCONFIGURED, CONFIGURING),
    Transition(10, _OK, CONFIGURING, INACTIVE),
    Transition(11, _NO, CONFIGURING, UNCONFIGURED),
    Transition(12, _BAD, CONFIGURING, ERROR_PROCESSING),
    Transition(2, "cleanup", INACTIVE, CLEANING_UP),
    Transition(20, _OK, CLEANING_UP, UNCONFIGURED),
    Transition(21, _NO, CLEANING_UP, INACTIVE),
    Transition(22, _BAD, CLEANING_UP, ERROR_PROCESSING),
    Transition(3, "activate", INACTIVE, ACTIVATING),
    Transition(30, _OK, ACTIVATING, ACTIVE),
    Transition(31, _NO, ACTIVATING, INACTIVE),
    Transition(32, _BAD, ACTIVATING, ERROR_PROCESSING),
    Transition(4, "deactivate", ACTIVE, DEACTIVATING),
    Transition(40, _OK, DEACTIVATING, INACTIVE),
    Transition(41, _NO, DEACTIVATING, ACTIVE),
    Transition(42, _BAD, DEACTIVATING, ERROR_PROCESSING),
    Transition(5, "shutdown", UNCONFIGURED, SHUTTING_DOWN),
    Transition(6, "shutdown", INACTIVE, SHUTTING_DOWN),
    Transition(7, "shutdown", ACTIVE, SHUTTING_DOWN),
    Transition(50, _OK, SHUTTING_DOWN, FINALIZED),
    Transition(51, _NO, SHUTTING_DOWN, FINALIZED),
    Transition(52, _BAD, SHUTTING_DOWN, ERROR_PROCESSING),
    Transition(60, _OK, ERROR_PROCESSING, UNCONFIGURED),
    Transition(61, _NO, ERROR_PROCESSING, FINALIZED),
    Transition(62, _BAD, ERROR_PROCESSING, FINALIZED),
)
_LABELS: Final = {Result.SUCCESS: _OK, Result.FAILURE: _NO, Result.ERROR: _BAD}


class StateMachine:
    """Where a managed node is. `request` starts a transition, `finish` ends it; both return the transition taken."""

    def __init__(self) -> None:
        self.state = UNCONFIGURED

    def available(self) -> tuple[Transition, ...]:
        """The transitions that start here, in the order in which ROS 2 lists them."""
        return tuple(transition for transition in TRANSITIONS if transition.start == self.state)

    def find(self, wanted: int | str) -> Transition | None:
        """The transition that a number or a label asks for from here; None where there is none."""
        for transition in self.available():
            if transition.requested and wanted in (transition.id, transition.label):
                return transition
        return None

    def request(self, wanted: int | str) -> Transition:
        """Enter the transition state; UsageError names what is possible instead."""
        transition = self.find(wanted)
        if transition is None:
            possible = ", ".join(other.label for other in self.available() if other.requested)
            raise UsageError(f"no transition {wanted!r} from {self.state.label}: {possible or 'nothing'} is possible")
        self.state = transition.goal
        return transition

    def finish(self, result: Result) -> Transition:
        """Leave the transition state as the callback's result says; UsageError in a primary state."""
        label = _LABELS[result]
        for transition in self.available():
            if not transition.requested and transition.label == label:
                self.state = transition.goal
                return transition
        raise UsageError(f"no transition is under way: the node is {self.state.label}")
