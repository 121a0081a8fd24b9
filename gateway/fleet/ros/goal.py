"""A goal of a robot's action server as a gateway follows it: its status, and its events."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import AsyncGenerator
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, Final, Literal

from gateway.errors import TooManyError
from gateway.fleet.ros.typed import decode
from metaros._proto import link_pb2
from metaros.errors import MetarosError
from metaros.idl import Catalogue
from metaros.limits import LIMITS

__all__ = ["ENDS", "STATUSES", "Goal", "GoalEvent", "GoalStatus"]

GoalStatus = Literal["accepted", "executing", "canceling", "succeeded", "canceled", "aborted", "rejected", "lost"]
STATUSES: Final[dict[int, GoalStatus]] = {
    1: "accepted",
    2: "executing",
    3: "canceling",
    4: "succeeded",
    5: "canceled",
    6: "aborted",
}
NUMBERS: Final = {name: number for number, name in STATUSES.items()}
ENDS: Final = frozenset({"succeeded", "canceled", "aborted", "rejected", "lost"})
LARGE_BYTES: Final = 32 * 1024  # beyond it decoding runs in a thread: the event loop never stops for 5 ms
PENDING: Final = 32  # events of one reader; a goal has fewer changes of its status


@dataclass(slots=True, eq=False)
class GoalEvent:
    """A goal's new status, feedback or result. `cdr` is the robot's X_FeedbackMessage, or its X_GetResult_Response."""

    kind: Literal["status", "feedback", "result"]
    status: GoalStatus
    stamp_ns: int = 0
    cdr: bytes = b""
    message: str = ""
    part: str = ""  # the type of `cdr`
    catalogue: Catalogue | None = field(default=None, repr=False)
    _value: Any = None
    _decoded: bool = False

    @property
    def value(self) -> Any:
        """The feedback, or the result, as JSON-able values; None where there is none, or its type is not known."""
        if not self._decoded:
            self._decoded = True
            if self.cdr and self.catalogue is not None:
                with suppress(MetarosError):  # whoever wants to know why has the bytes
                    inner = "feedback" if self.kind == "feedback" else "result"
                    self._value = decode(self.part, self.cdr, self.catalogue)[inner]
        return self._value

    async def load(self) -> None:
        """See to it that `value` costs nothing."""
        if len(self.cdr) > LARGE_BYTES and not self._decoded:
            await asyncio.to_thread(lambda: self.value)


class _Reader:
    """What somebody has not read yet. Of feedback the newest waits, of the rest everything."""

    def __init__(self) -> None:
        self.pending: deque[GoalEvent] = deque(maxlen=PENDING)
        self.wake = asyncio.Event()

    def put(self, event: GoalEvent) -> None:
        """One more."""
        if event.kind == "feedback":
            self.pending = deque((one for one in self.pending if one.kind != "feedback"), maxlen=PENDING)
        self.pending.append(event)
        self.wake.set()


class Goal:
    """One goal. What it is never changes; how it stands changes until `ended`."""

    def __init__(
        self,
        robot: str,
        goal_id: bytes,
        action: str,
        type_name: str,
        catalogue: Catalogue | None,
        *,
        by: str = "",
        started_ns: int = 0,
    ) -> None:
        self.robot, self.goal_id, self.action, self.type_name = robot, goal_id, action, type_name
        self.by, self.started_ns = by, started_ns
        self.accepted = False
        self.reachable = True
        self.status: GoalStatus = "accepted"
        self.message = ""
        self.skipped = 0  # feedback that the robot left out, as newer one was there
        self.changed_s = 0.0  # when it was last heard of, or lost sight of, by the monotonic clock
        self.newest_feedback: GoalEvent | None = None
        self.end: GoalEvent | None = None
        self._catalogue = catalogue
        self._readers: set[_Reader] = set()

    @property
    def id(self) -> str:
        """Its 16 bytes as 32 hexadecimal digits."""
        return self.goal_id.hex()

    @property
    def ended(self) -> bool:
        """Whether nothing more will be told of it."""
        return self.end is not None

    @property
    def status_number(self) -> int:
        """The number of action_msgs/msg/GoalStatus; 0 where that has none."""
        return NUMBERS.get(self.status, 0)

    @property
    def result(self) -> Any:
        """What it gave, as JSON-able values; None while there is nothing."""
        return self.end.value if self.end is not None else None

    @property
    def result_cdr(self) -> bytes:
        """The robot's X_GetResult_Response; b"" while there is none."""
        return self.end.cdr if self.end is not None else b""

    async def events(self) -> AsyncGenerator[GoalEvent, None]:
        """How it stands, then what comes, until its result. TooManyError when too many listen already."""
        self.check_room()
        reader = _Reader()
        for event in (GoalEvent("status", self.status, message=self.message), self.newest_feedback, self.end):
            if event is not None:
                reader.put(event)
        self._readers.add(reader)
        try:
            while True:
                while reader.pending:
                    event = reader.pending.popleft()
                    await event.load()
                    yield event
                    if event.kind == "result":
                        return
                reader.wake.clear()
                await reader.wake.wait()
        finally:
            self._readers.discard(reader)

    def check_room(self) -> None:
        """TooManyError when no further client may listen."""
        if len(self._readers) >= LIMITS.goal_readers:
            raise TooManyError(f"{LIMITS.goal_readers} clients listen to goal {self.id} already")

    def take(self, report: link_pb2.GoalEvent) -> None:
        """What the robot says of it. After its end nothing counts any more."""
        if self.end is not None:
            return
        self.accepted = True
        status = STATUSES.get(report.status, self.status)
        self.skipped = report.skipped
        if report.feedback:
            part = f"{self.type_name}_FeedbackMessage"
            event = GoalEvent("feedback", self.status, report.stamp_ns, report.feedback, part=part)
            event.catalogue = self._catalogue
            self.newest_feedback = event
            self._report(event)
        if report.ended:
            self.finish(status if status in ENDS else "lost", report)
        elif status != self.status or not self.reachable:
            self.status, self.reachable, self.message = status, True, ""
            self._report(GoalEvent("status", status, report.stamp_ns))

    def unreachable(self, now_s: float) -> None:
        """Its robot has no link any more: nobody knows how it stands."""
        if self.end is None and self.reachable:
            self.reachable, self.changed_s, self.message = False, now_s, "the robot has no link now"
            self._report(GoalEvent("status", self.status, message=self.message))

    def finish(self, status: GoalStatus, report: link_pb2.GoalEvent) -> None:
        """It is over. Nothing happens the second time."""
        if self.end is not None:
            return
        self.status, self.message = status, report.message
        part = f"{self.type_name}_GetResult_Response"
        self.end = GoalEvent("result", status, report.stamp_ns, report.result, report.message, part, self._catalogue)
        self._report(self.end)

    def _report(self, event: GoalEvent) -> None:
        for reader in self._readers:
            reader.put(event)
