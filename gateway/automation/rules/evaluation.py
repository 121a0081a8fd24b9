"""One transaction's worth of evaluation: what rules remember, what they fire, what they count. Nothing of it is stored
until the evaluation is through, so that it can begin anew where somebody else was faster.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import orjson

from gateway.domain.happening import Happening
from gateway.domain.rule import RuleState
from gateway.errors import StoreError
from gateway.rules.firing import Firing
from gateway.rules.rule import Rule
from gateway.store.engine import StoreEngine
from gateway.store.rule_states import read_states
from metaros.limits import LIMITS, Limits
from metaros.rules.when import State, When, at_rest, due, group_of, step, value_of

__all__ = ["Known", "Remembered", "Tally", "Turn", "happening_json", "read_happening", "remembered"]

log = logging.getLogger(__name__)
ERROR_CHARS = 500


class Remembered(NamedTuple):
    """A row, and what it says."""

    row: RuleState
    state: State


Known = dict[tuple[str, str], Remembered]


@dataclass(slots=True)
class Tally:
    """What a rule did in this turn."""

    matched: int = 0
    fired: int = 0
    errors: int = 0
    error: str = ""


@dataclass(slots=True)
class Turn:
    """`known` is what a gateway remembers of former turns; it is read, and not written. Where it is `complete`, what is
    not in it is nowhere else.
    """

    engine: StoreEngine
    now_ns: int
    known: Known
    limits: Limits = LIMITS
    complete: bool = False
    changed: Known = field(default_factory=dict)
    firings: list[Firing] = field(default_factory=list)
    tallies: dict[str, Tally] = field(default_factory=dict)
    seen: Known = field(default_factory=dict)

    def tally(self, rule: Rule) -> Tally:
        """What the rule did so far."""
        return self.tallies.setdefault(rule.name, Tally())

    def failed(self, rule: Rule, error: Exception) -> None:
        """A rule's mistake: it is counted, and ends nothing. A StoreError is no rule's mistake, and goes on."""
        if isinstance(error, StoreError):
            raise error
        tally = self.tally(rule)
        tally.errors += 1
        tally.error = f"{type(error).__name__}: {error}"[:ERROR_CHARS].replace("\0", "")
        log.debug("rule %s failed", rule.name, exc_info=error)

    def judge(self, rule: Rule, happening: Happening, event: Mapping[str, Any], *, matched: bool) -> None:
        """A happening of a rule's own: it counts, or it does not (which a condition with a memory may want to know)."""
        try:
            if matched:
                self.tally(rule).matched += 1
            if rule.when is None:
                if matched:
                    self.fire(rule, happening, "")
                return
            self.step(rule, rule.when, group_of(rule.when, event), happening, matched, value_of(rule.when, event))
        except Exception as error:  # whatever somebody put into a rule or an event
            self.failed(rule, error)

    def step(
        self, rule: Rule, when: When, group: str, happening: Happening, matched: bool, value: float | None
    ) -> None:
        """A rule with a memory takes one more step in a group."""
        before = self.of(rule, group)
        done = step(when, before.state, matched, value, self.now_ns)
        self.keep(rule, when, group, before, done.state, done.due_ns or 0, happening if matched else None)
        if done.fired:
            self.fire(rule, happening, group)
        if done.ended:
            self.firings.append(Firing(rule=rule, happening=happening, group=group, now_ns=self.now_ns, ended=True))

    def ring(self, rule: Rule, row: RuleState) -> None:
        """A rule's timer has run out in a group."""
        assert rule.when is not None
        before = self.of(rule, row.group)
        done = due(rule.when, before.state, self.now_ns)
        last = read_happening(before.row.last) if before.row.last else None
        self.keep(rule, rule.when, row.group, before, done.state, done.due_ns or 0, last)
        if done.fired and last is not None:
            self.fire(rule, last, row.group, by_timer_ns=row.due_ns)

    def fire(self, rule: Rule, happening: Happening, group: str, *, by_timer_ns: int = 0) -> None:
        """The rule fires."""
        self.tally(rule).fired += 1
        self.firings.append(
            Firing(rule=rule, happening=happening, group=group, now_ns=self.now_ns, by_timer_ns=by_timer_ns)
        )

    def of(self, rule: Rule, group: str) -> Remembered:
        """What a rule remembers of a group."""
        key = (rule.name, group)
        found = self.changed.get(key) or self.seen.get(key) or self.known.get(key)
        if found is None:
            rows = {} if self.complete else read_states(self.engine, [key])
            row = rows.get(key) or RuleState(rule=rule.name, group=group, token=rule.token, state="")
            found = remembered(row)
        if found.row.token != rule.token:  # it is of what the rule was before it was changed
            found = Remembered(replace(found.row, token=rule.token, last="", due_ns=0), State())
        self.seen[key] = found
        return found

    def rests(self, rule: Rule, group: str) -> bool:
        """Whether nothing is remembered of a group, for certain."""
        key = (rule.name, group)
        return self.complete and key not in self.known and key not in self.changed

    def keep(
        self,
        rule: Rule,
        when: When,
        group: str,
        before: Remembered,
        state: State,
        due_ns: int,
        happening: Happening | None,
    ) -> None:
        """Remember a state from now on; one that says nothing is forgotten, which is `state` ""."""
        if replace(state, seen_ns=before.state.seen_ns) == before.state and due_ns == before.row.due_ns:
            return
        last = ""
        if due_ns:
            last = happening_json(happening, self.limits) if happening is not None else before.row.last
        text = "" if at_rest(when, state, self.now_ns) else orjson.dumps(state.to_json()).decode()
        row = replace(before.row, token=rule.token, state=text, last=last, due_ns=due_ns)
        self.changed[rule.name, group] = Remembered(row, state)


def remembered(row: RuleState) -> Remembered:
    """A row, read."""
    return Remembered(row, State.from_json(orjson.loads(row.state)) if row.state else State())


def happening_json(one: Happening, limits: Limits = LIMITS) -> str:
    """A happening as a row keeps it; of one that is too large, what it is about."""
    text = orjson.dumps([one.id, one.type, one.source, one.at_ns, one.robot, dict(one.data)])
    if len(text) > limits.rule_payload_bytes:
        less = {"omitted": {"reason": "too_large", "size_bytes": len(text)}}
        text = orjson.dumps([one.id, one.type, one.source, one.at_ns, one.robot, less])
    return text.decode()


def read_happening(text: str) -> Happening:
    """The reverse."""
    happening_id, kind, source, at_ns, robot, data = orjson.loads(text)
    return Happening(id=happening_id, type=kind, source=source, at_ns=at_ns, robot=robot, data=data)
