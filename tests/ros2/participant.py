"""Who takes part in a scenario: our two faces and their peers all do the same things, as far as they can."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from typing import Any, Protocol

__all__ = ["PATIENT", "SPEED", "Fields", "GoalRun", "Participant", "Seen", "clocked", "fibonacci", "managed"]

Fields = dict[str, Any]  # a message as plain values, by the names of its fields

SPEED = 0.5  # the parameter `speed` of every node that has parameters; it must be within 0 and 1
PATIENT = 30  # a Fibonacci goal of a higher order goes on until it is cancelled; a negative one is refused


@dataclass(frozen=True)
class Seen:
    """A publisher (MP) or subscription (MS) as somebody sees it in the graph; `depth` 0 is not known."""

    kind: str
    node: str
    type_name: str
    type_hash: str
    reliability: str
    durability: str
    depth: int


@dataclass
class GoalRun:
    """What became of a goal: its status in ROS 2's words ("SUCCEEDED"; "REJECTED" where it was not accepted)."""

    status: str
    sequence: list[int] = field(default_factory=list)
    feedback: list[list[int]] = field(default_factory=list)


class Participant(Protocol):
    """The node `/<name>`; it lives as long as the tests.

    It may offer the service `~/add` (AddTwoInts), which logs "a + b" on /rosout; `~/now` (Trigger), its time in ns; the
    action `~/fibonacci`; the parameter `speed`; the lifecycle node `/<name>_managed`; and `/<name>_clocked`, which has
    `~/now`, too, and follows /clock. What it cannot do stands in
    tests/ros2/cast.py.
    """

    @property
    def name(self) -> str: ...

    def lending(self) -> AbstractContextManager[None]:
        """What a test makes meanwhile goes at its end."""
        ...

    def speak(self, topic: str, type_name: str, fields: Fields, *, latched: bool = False) -> Callable[[], object]:
        """A publisher, as a function that publishes those fields."""
        ...

    def listen(self, topic: str, type_name: str, *, latched: bool = False) -> Callable[[], list[Fields]]:
        """A subscription, as a function: all that was heard so far."""
        ...

    def add(self, server: str, a: int, b: int) -> int:
        """Ask `/<server>/add`."""
        ...

    def now(self, server: str) -> int:
        """Ask `/<server>/now`."""
        ...

    def run_goal(self, server: str, order: int, *, cancel: bool = False) -> GoalRun:
        """A goal for `/<server>/fibonacci`, to its end; `cancel` once it has begun."""
        ...

    def parameters(self, node: str) -> dict[str, Any]:
        """The names of a node's parameters, and their values."""
        ...

    def set_parameter(self, node: str, name: str, value: object) -> str | None:
        """None where it is obeyed, else the reason of the refusal."""
        ...

    def state(self, node: str) -> str:
        """Of a lifecycle node: its label."""
        ...

    def change_state(self, node: str, transition: str) -> bool:
        """Ask a lifecycle node; whether it obeyed."""
        ...

    def nodes(self) -> set[str]:
        """Full names, as it sees the graph."""
        ...

    def endpoints(self, topic: str) -> list[Seen]:
        """Publishers and subscriptions, as it sees the graph."""
        ...

    def describe(self, node: str, type_name: str, type_hash: str) -> list[Fields]:
        """What `/<node>/get_type_description` tells: the type, then those that it refers to."""
        ...

    def close(self) -> None:
        """Leave."""
        ...


def managed(name: str) -> str:
    """The lifecycle node of a participant."""
    return f"{name}_managed"


def clocked(name: str) -> str:
    """The node of a participant that follows /clock."""
    return f"{name}_clocked"


def fibonacci(order: int) -> list[list[int]]:
    """What a goal of that order tells as feedback; the last is its result."""
    sequence, told = [0, 1], []
    for at in range(1, order):
        sequence.append(sequence[at] + sequence[at - 1])
        told.append(list(sequence))
    return told
