"""Checks that need no metric: silent robots, late rows, flapping links, lost samples, crashing nodes.

All times here are the gateway's, apart from the newest stamp of a robot's rows.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from gateway.alerting.anomaly.checks import Check, CheckTable

__all__ = ["FactChange", "Facts"]

EVENTS = 64  # kept of one counted thing
HERE_S = 5.0  # since it was heard last: rows are late only of a robot that is here
COUNTED = 256  # counted things a robot (streams, nodes)


@dataclass(frozen=True, slots=True)
class FactChange:
    """A check about a robot opened or closed; `where` is a stream or node, or empty."""

    robot: str
    check: Check
    where: str
    opened: bool
    value: float
    since_s: float


@dataclass(slots=True)
class Robot:
    """What is known of one robot. `bad` holds, by (check, where), since when, the last bad moment, and if it fires."""

    heard_s: float | None = None
    up: bool | None = None
    newest_s: float | None = None
    events: dict[tuple[str, str], deque[tuple[float, float]]] = field(default_factory=dict)
    bad: dict[tuple[str, str], list[Any]] = field(default_factory=dict)


class Facts:
    """Counts and deadlines of all robots; bounded a robot."""

    def __init__(self, table: CheckTable) -> None:
        self.table = table
        self.robots: dict[str, Robot] = {}

    def heartbeat(self, robot: str, now_s: float, *, newest_s: float | None = None) -> None:
        """A sign of life; `newest_s` is the newest stamp of its rows."""
        known = self.robots.setdefault(robot, Robot())
        known.heard_s = now_s
        known.newest_s = newest_s if newest_s is not None else known.newest_s

    def link(self, robot: str, *, up: bool, now_s: float) -> None:
        """The link went up or down."""
        known = self.robots.setdefault(robot, Robot())
        if up and known.up is False:
            self.count(robot, "link_flaps", "", 1.0, now_s)
        if up or known.heard_s is None:
            known.heard_s = now_s
        known.up = up

    def count(self, robot: str, check_id: str, where: str, amount: float, now_s: float) -> None:
        """Something to be counted happened."""
        known = self.robots.setdefault(robot, Robot())
        if (check_id, where) not in known.events and len(known.events) >= COUNTED:
            return
        known.events.setdefault((check_id, where), deque(maxlen=EVENTS)).append((now_s, amount))

    def tick(self, now_s: float) -> Iterator[FactChange]:
        """What opened and closed by now."""
        for name, known in self.robots.items():
            for check_id, where, value, breached in self._looks(known, now_s):
                check = self.table.get(check_id)
                yield from self._hold(name, known, check, check_id, where, value, breached, now_s)

    def waited(self, robot: str, since_s: float) -> None:
        """Nobody could hear the robot before: it has its time to come from then on, unless it was offline already."""
        known = self.robots.setdefault(robot, Robot())
        if ("offline", "") not in known.bad:
            known.heard_s = since_s if known.heard_s is None else max(known.heard_s, since_s)

    def dump(self, robot: str | None = None) -> dict[str, Any]:
        """Everything, of one robot or of all, as JSON takes it."""
        return {
            name: {
                "heard_s": known.heard_s,
                "up": known.up,
                "newest_s": known.newest_s,
                "events": [[*key, [list(event) for event in events]] for key, events in known.events.items()],
                "bad": [[*key, state] for key, state in known.bad.items()],
            }
            for name, known in self.robots.items()
            if robot in (None, name)
        }

    def load(self, dumped: dict[str, Any]) -> None:
        """Take over what `dump` gave."""
        for name, item in dumped.items():
            events = {
                (check, where): deque(((at, amount) for at, amount in row), maxlen=EVENTS)
                for check, where, row in item["events"]
            }
            bad = {(check, where): list(state) for check, where, state in item["bad"]}
            self.robots[name] = Robot(item["heard_s"], item["up"], item["newest_s"], events, bad)

    def _looks(self, known: Robot, now_s: float) -> Iterator[tuple[str, str, float, bool]]:
        """(check, where, value, breached) of everything there is to look at."""
        if known.heard_s is not None:
            quiet_s = now_s - known.heard_s
            limit_s = check.for_s if (check := self.table.named("offline")) is not None else 0.0
            yield "offline", "", quiet_s, quiet_s >= limit_s
            if known.newest_s is not None:
                late_s, here = now_s - known.newest_s, quiet_s < HERE_S
                for check_id, value in (("behind", late_s), ("ahead", -late_s)):
                    limit = check.high if (check := self.table.named(check_id)) is not None else None
                    yield check_id, "", value, here and limit is not None and value >= limit
        for key, events in list(known.events.items()):
            check = self.table.named(key[0])
            window_s = check.window_s if check is not None else 0.0
            while events and not 0.0 <= now_s - events[0][0] <= window_s:
                events.popleft()
            total = sum(amount for _, amount in events)
            yield *key, total, check is not None and check.high is not None and total >= check.high
            if not events and key not in known.bad:
                del known.events[key]

    def _hold(
        self, name: str, known: Robot, check: Check | None, check_id: str, where: str, value: float, breached: bool,
        now_s: float,
    ) -> Iterator[FactChange]:  # fmt: skip
        """pending -> firing -> over. An offline's wait is in its value, a count's in its window."""
        key = (check_id, where)
        state = known.bad.get(key)
        if check is None or (not breached and state is None):
            if state is not None:
                del known.bad[key]
            return
        if state is None:
            state = known.bad[key] = [now_s, now_s, False]
        if breached:
            state[1] = now_s
            waits = check_id in ("behind", "ahead")
            if not state[2] and (not waits or now_s - state[0] >= check.for_s):
                state[2] = True
                since_s = now_s - value if check_id == "offline" else state[0]
                yield FactChange(name, check, where, True, value, since_s)
        elif not state[2]:
            del known.bad[key]
        elif not 0.0 <= now_s - state[1] < (check.clear_s if check_id in ("offline", "behind", "ahead") else 0.0):
            del known.bad[key]
            yield FactChange(name, check, where, False, value, state[0])
