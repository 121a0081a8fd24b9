"""The life of a goal, as a pure state machine: events and `now` in, states out; ROS 2's own table.

ACCEPTED ──execute──> EXECUTING ──succeed──> SUCCEEDED
    │                     │ └─────abort────> ABORTED
    └─cancel──> CANCELING <┘cancel
                    └──canceled──> CANCELED     (or succeed, or abort: the goal may be done before it can stop)
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field
from enum import Enum, IntEnum
from typing import Any, Final

from metaros.errors import UsageError

__all__ = ["TERMINAL", "TRANSITIONS", "CancelCode", "Goal", "GoalEvent", "GoalState", "GoalTable"]

NO_ID: Final = bytes(16)


class GoalState(IntEnum):
    """The numbers of action_msgs/msg/GoalStatus."""

    UNKNOWN = 0
    ACCEPTED = 1
    EXECUTING = 2
    CANCELING = 3
    SUCCEEDED = 4
    CANCELED = 5
    ABORTED = 6


class GoalEvent(Enum):
    """What may happen to a goal."""

    EXECUTE = "execute"
    CANCEL = "cancel"
    SUCCEED = "succeed"
    ABORT = "abort"
    CANCELED = "canceled"


class CancelCode(IntEnum):
    """The return codes of action_msgs/srv/CancelGoal."""

    NONE = 0
    REJECTED = 1
    UNKNOWN_GOAL = 2
    TERMINATED = 3


TRANSITIONS: Final[dict[tuple[GoalState, GoalEvent], GoalState]] = {
    (GoalState.ACCEPTED, GoalEvent.EXECUTE): GoalState.EXECUTING,
    (GoalState.ACCEPTED, GoalEvent.CANCEL): GoalState.CANCELING,
    (GoalState.EXECUTING, GoalEvent.CANCEL): GoalState.CANCELING,
    (GoalState.EXECUTING, GoalEvent.SUCCEED): GoalState.SUCCEEDED,
    (GoalState.EXECUTING, GoalEvent.ABORT): GoalState.ABORTED,
    (GoalState.CANCELING, GoalEvent.SUCCEED): GoalState.SUCCEEDED,
    (GoalState.CANCELING, GoalEvent.ABORT): GoalState.ABORTED,
    (GoalState.CANCELING, GoalEvent.CANCELED): GoalState.CANCELED,
}
TERMINAL: Final = frozenset({GoalState.SUCCEEDED, GoalState.CANCELED, GoalState.ABORTED})


@dataclass(slots=True, eq=False)
class Goal:
    """One goal. `stamp_ns` is when it was accepted, `done_s` when it reached its end."""

    goal_id: bytes
    stamp_ns: int
    state: GoalState = GoalState.ACCEPTED
    done_s: float | None = None
    payload: Any = field(default=None, repr=False)  # whatever the owner of the table keeps with it

    @property
    def is_active(self) -> bool:
        """Whether it has not reached its end."""
        return self.state not in TERMINAL

    def may(self, event: GoalEvent) -> bool:
        """Whether the table has such a transition from here."""
        return (self.state, event) in TRANSITIONS

    def apply(self, event: GoalEvent, now_s: float) -> GoalState:
        """Change the state; UsageError where the table has no such transition."""
        after = TRANSITIONS.get((self.state, event))
        if after is None:
            raise UsageError(f"a goal that is {self.state.name} cannot {event.value}")
        self.state = after
        if after in TERMINAL:
            self.done_s = now_s
        return after


class GoalTable:
    """The goals of one server: at most `limit`, done ones for `keep_s` after their end. Not thread-safe."""

    def __init__(self, *, keep_s: float, limit: int) -> None:
        if not keep_s >= 0:
            raise UsageError(f"results are kept for zero seconds or more, not {keep_s}")
        self.keep_s = keep_s
        self.limit = limit
        self._active: dict[bytes, Goal] = {}  # in the order of acceptance
        self._done: dict[bytes, Goal] = {}  # in the order of their ends, and so of their expiry

    def __len__(self) -> int:
        return len(self._active) + len(self._done)

    def get(self, goal_id: bytes) -> Goal | None:
        """The goal of this id."""
        return self._active.get(goal_id) or self._done.get(goal_id)

    @property
    def active(self) -> list[Goal]:
        """The goals that have not reached their end, oldest first."""
        return list(self._active.values())

    def has_room(self) -> bool:
        """Whether another goal may be accepted: when full, the oldest done one makes room."""
        return len(self._active) < self.limit

    def accept(self, goal_id: bytes, stamp_ns: int) -> Goal:
        """A new goal, ACCEPTED; UsageError when its id is taken or the table is full of active goals."""
        if self.get(goal_id) is not None:
            raise UsageError(f"goal {goal_id.hex()} exists already")
        if not self.has_room():
            raise UsageError(f"{self.limit} goals are active: the limit")
        if len(self) >= self.limit:
            del self._done[next(iter(self._done))]
        goal = self._active[goal_id] = Goal(goal_id, stamp_ns)
        return goal

    def apply(self, goal: Goal, event: GoalEvent, now_s: float) -> GoalState:
        """Change the state of one; UsageError where there is no such transition."""
        after = goal.apply(event, now_s)
        if after in TERMINAL and self._active.pop(goal.goal_id, None) is not None:
            self._done[goal.goal_id] = goal
        return after

    def to_cancel(self, goal_id: bytes, stamp_ns: int) -> tuple[CancelCode, list[Goal]]:
        """The goals that a CancelGoal request means, of those that can still be cancelled.

        An id alone means that goal; a stamp alone every goal accepted at or before it; both, either; none, all.
        """
        if goal_id != NO_ID and stamp_ns == 0:
            goal = self.get(goal_id)
            if goal is None:
                return CancelCode.UNKNOWN_GOAL, []
            return (CancelCode.NONE, [goal]) if goal.may(GoalEvent.CANCEL) else (CancelCode.TERMINATED, [])
        until_ns = math.inf if goal_id == NO_ID and stamp_ns == 0 else stamp_ns
        meant = [goal for goal in self.active if goal.goal_id == goal_id or goal.stamp_ns <= until_ns]
        return CancelCode.NONE, [goal for goal in meant if goal.may(GoalEvent.CANCEL)]

    def expire(self, now_s: float) -> list[Goal]:
        """Forget the goals that were done at least `keep_s` ago, and return them."""
        gone = []
        while (due_s := self.next_expiry_s()) is not None and due_s <= now_s:
            gone.append(self._done.pop(next(iter(self._done))))
        return gone

    def next_expiry_s(self) -> float | None:
        """When `expire` will next have something to do; None when nothing will."""
        first = next(iter(self._done.values()), None)
        if first is None or first.done_s is None or self.keep_s == math.inf:
            return None
        return first.done_s + self.keep_s

    def listed(self, done: int) -> list[Goal]:
        """The content of the status topic: the `done` last finished goals and every active one, oldest first."""
        last = list(itertools.islice(reversed(self._done.values()), done))
        return [*reversed(last), *self._active.values()]
