"""Registry of the goals that this agent tracks: each one's status, and what has to be reported. Pure."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass
from typing import Final

from edge_agent.errors import BusyError
from metaros._proto import link_pb2
from metaros.clock import Clock
from metaros.limits import LIMITS, Limits

__all__ = ["GoalRegistry", "TrackedGoal"]

ENDED: Final = (4, 5, 6)  # succeeded, canceled, aborted
TURN_BYTES: Final = 256 * 1024  # of feedback that is sent at a time


@dataclass(slots=True, eq=False)
class TrackedGoal:
    """One goal."""

    goal_id: bytes
    action: str
    type_name: str
    type_hash: str
    status: int = 1
    ended: bool = False
    result: bytes = b""
    code: str = ""
    message: str = ""
    stamp_ns: int = 0
    skipped: int = 0
    ended_s: float = 0.0
    feedback: bytes = b""  # not sent yet
    told_s: float = float("-inf")  # when feedback was sent last

    def event(self) -> link_pb2.GoalEvent:
        """How it stands."""
        return link_pb2.GoalEvent(
            goal_id=self.goal_id,
            action=self.action,
            type_name=self.type_name,
            type_hash=self.type_hash,
            status=self.status,
            ended=self.ended,
            result=self.result,
            code=self.code,
            message=self.message[:1024],
            stamp_ns=self.stamp_ns,
            skipped=self.skipped,
        )


class GoalRegistry:
    """All of them, the oldest first. Not thread-safe, but for `find`."""

    def __init__(self, clock: Clock, *, limits: Limits = LIMITS) -> None:
        self._clock = clock
        self._limits = limits
        self._goals: OrderedDict[bytes, TrackedGoal] = OrderedDict()
        self._fresh: dict[bytes, TrackedGoal] = {}

    def begin(self, goal_id: bytes, action: str, type_name: str, type_hash: str) -> TrackedGoal:
        """Follow one from before it is sent. BusyError when there are too many."""
        self._forget_old()
        if sum(not goal.ended for goal in self._goals.values()) >= self._limits.goals_open:
            raise BusyError(f"{self._limits.goals_open} goals are under way")
        if len(self._goals) >= self._limits.goals_kept:
            del self._goals[next(key for key, goal in self._goals.items() if goal.ended)]
        goal = self._goals[goal_id] = TrackedGoal(goal_id, action, type_name, type_hash, stamp_ns=self._clock.wall_ns())
        return goal

    def drop(self, goal: TrackedGoal) -> None:
        """It never came to be."""
        self._goals.pop(goal.goal_id, None)
        self._fresh.pop(goal.goal_id, None)

    def find(self, goal_id: bytes) -> TrackedGoal | None:
        """One of them."""
        return self._goals.get(goal_id)

    def status(self, goal_id: bytes, number: int) -> TrackedGoal | None:
        """The server says how it stands; the goal where that is news, and no end: its result says that."""
        goal = self._goals.get(goal_id)
        if goal is None or goal.ended or number <= goal.status or number in ENDED:
            return None
        goal.status, goal.stamp_ns = number, self._clock.wall_ns()
        return goal

    def fed_back(self, goal_id: bytes, feedback: bytes, *, skipped: int = 0) -> None:
        """The newest feedback, after so many that nobody looked at; what waits is replaced."""
        goal = self._goals.get(goal_id)
        if goal is None or goal.ended:
            return
        goal.skipped += skipped
        if goal.feedback or len(feedback) > self._limits.goal_feedback_bytes:
            goal.skipped += 1
        if len(feedback) <= self._limits.goal_feedback_bytes:
            goal.feedback, goal.stamp_ns = feedback, self._clock.wall_ns()
            self._fresh[goal_id] = goal

    def end(self, goal: TrackedGoal, *, status: int, result: bytes = b"", code: str = "", message: str = "") -> None:
        """Nothing more comes of it."""
        goal.ended, goal.status, goal.result, goal.code, goal.message = True, status, result, code, message
        goal.stamp_ns, goal.ended_s = self._clock.wall_ns(), self._clock.monotonic_s()

    def due(self) -> list[link_pb2.GoalEvent]:
        """Feedback that may be sent now: each goal's at its rate, all together at most TURN_BYTES."""
        events: list[link_pb2.GoalEvent] = []
        now_s, size = self._clock.monotonic_s(), 0
        for goal_id, goal in list(self._fresh.items()):
            if now_s - goal.told_s < 1 / self._limits.goal_feedback_hz:
                continue
            if events and size + len(goal.feedback) > TURN_BYTES:
                break
            size += len(goal.feedback)
            events.append(self.take_feedback(goal))
            self._fresh.pop(goal_id, None)
        return events

    def take_feedback(self, goal: TrackedGoal) -> link_pb2.GoalEvent:
        """Its newest feedback as an event to send."""
        event = goal.event()
        event.ended, event.result = False, b""
        event.feedback, goal.feedback, goal.told_s = goal.feedback, b"", self._clock.monotonic_s()
        self._fresh.pop(goal.goal_id, None)
        return event

    @property
    def waits(self) -> bool:
        """Whether feedback waits to be sent."""
        return bool(self._fresh)

    def all(self) -> list[TrackedGoal]:
        """Every goal that is known, the oldest first."""
        self._forget_old()
        return list(self._goals.values())

    def _forget_old(self) -> None:
        before_s = self._clock.monotonic_s() - self._limits.goal_kept_s
        for goal in [one for one in self._goals.values() if one.ended and one.ended_s < before_s]:
            self.drop(goal)
