"""Evaluates triggers: which messages the handler is called for, by pattern and stateful condition.

No input or output of its own: events in, what is to be kept out. Time is the robot's wall clock, passed in.
"""

from __future__ import annotations

import json
from collections import OrderedDict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from metaros.automation.robot.backlog import ConditionState, NewEvent
from metaros.automation.robot.manifest import Trigger
from metaros.automation.rules.when import State, When, at_rest, due, group_of, step, value_of
from metaros.limits import LIMITS, Limits

__all__ = ["Evaluator", "Verdict"]


@dataclass(slots=True)
class Verdict:
    """What came of some messages: events to keep, and what is remembered from now on ("" as a state: nothing)."""

    puts: list[NewEvent] = field(default_factory=list)
    condition_states: list[ConditionState] = field(default_factory=list)


@dataclass(slots=True)
class _Group:
    """A condition's memory; `last` is the newest event that matched, which a timer acts with."""

    state: State
    last: bytes = b""
    due_ns: int = 0


class Evaluator:
    """Used by one thread. Store each verdict in one transaction, or evaluate again with a new Evaluator."""

    def __init__(
        self, triggers: Sequence[Trigger], kept: Iterable[ConditionState] = (), *, limits: Limits = LIMITS
    ) -> None:
        """`kept` is what an earlier one remembered; of triggers that are gone it is let go."""
        self._limits = limits
        self._groups: dict[str, OrderedDict[str, _Group]] = {each.name: OrderedDict() for each in triggers}
        self._whens: dict[str, When] = {each.name: each.when for each in triggers if each.when is not None}
        for one in sorted(kept, key=lambda memory: memory.seen_ns):
            if one.trigger in self._whens:
                state = State.from_json(json.loads(one.state))
                self._groups[one.trigger][one.part] = _Group(state, one.last, one.due_ns)

    def evaluate(self, trigger: Trigger, event: Mapping[str, Any], now_ns: int) -> Verdict:
        """A message that a trigger listens for."""
        verdict = Verdict()
        matched = trigger.pattern is None or trigger.pattern.matches(event)
        if trigger.when is None:
            if matched:
                verdict.puts.append(_put(trigger.name, str(event["id"]), _text(event), now_ns))
            return verdict
        when, part = trigger.when, group_of(trigger.when, event)
        group = self._group(trigger.name, part, verdict)
        before, due_before = group.state, group.due_ns
        done = step(when, before, matched, value_of(when, event), now_ns)
        text = _text(event) if matched and (done.fired or done.due_ns) else b""
        group.state, group.due_ns = done.state, done.due_ns or 0
        group.last = (text or group.last) if group.due_ns else b""
        if done.fired:
            verdict.puts.append(_put(trigger.name, str(event["id"]), text or _text(event), now_ns))
        if _differs(before, group.state) or due_before != group.due_ns:
            self._remember(trigger.name, part, group, now_ns, verdict)
        return verdict

    def elapse(self, now_ns: int) -> Verdict:
        """Timers whose time has come."""
        verdict = Verdict()
        for name, groups in self._groups.items():
            for part, group in list(groups.items()):
                if group.due_ns and group.due_ns <= now_ns:
                    self._ring(name, part, group, now_ns, verdict)
        return verdict

    def next_ns(self) -> int | None:
        """When the next timer is due."""
        waits = [group.due_ns for groups in self._groups.values() for group in groups.values() if group.due_ns]
        return min(waits, default=None)

    def _ring(self, name: str, part: str, group: _Group, now_ns: int, verdict: Verdict) -> None:
        due_ns, last = group.due_ns, group.last
        done = due(self._whens[name], group.state, now_ns)
        group.state, group.due_ns = done.state, done.due_ns or 0
        if done.fired and last:
            # The event counted before perhaps, as another one's: what the timer makes of it has a name of its own.
            verdict.puts.append(_put(name, f"{json.loads(last)['id']}@{due_ns}", last, now_ns))
        self._remember(name, part, group, now_ns, verdict)

    def _group(self, name: str, part: str, verdict: Verdict) -> _Group:
        groups = self._groups[name]
        group = groups.get(part)
        if group is None:
            group = groups[part] = _Group(State())
            if len(groups) > self._limits.robot_groups:
                gone, _ = groups.popitem(last=False)
                verdict.condition_states.append(
                    ConditionState(trigger=name, part=gone, state="", last=b"", due_ns=0, seen_ns=0)
                )
        groups.move_to_end(part)
        return group

    def _remember(self, name: str, part: str, group: _Group, now_ns: int, verdict: Verdict) -> None:
        rests = at_rest(self._whens[name], group.state, now_ns)
        state = "" if rests else json.dumps(group.state.to_json())
        verdict.condition_states.append(
            ConditionState(trigger=name, part=part, state=state, last=group.last, due_ns=group.due_ns, seen_ns=now_ns)
        )
        if rests:
            self._groups[name].pop(part, None)


def _put(trigger: str, name: str, payload: bytes, now_ns: int) -> NewEvent:
    return NewEvent(trigger=trigger, name=name, payload=payload, at_ns=now_ns)


def _text(event: Mapping[str, Any]) -> bytes:
    return json.dumps(event, ensure_ascii=False, separators=(",", ":")).encode("utf-8", "replace")


def _differs(one: State, other: State) -> bool:
    """Whether what is worth a write has changed: the clock's own stamp is not."""
    before, after = one.to_json(), other.to_json()
    before.pop("seen_ns", None)
    after.pop("seen_ns", None)
    return before != after
