"""One transaction's worth of evaluation: what rules remember, what they fire, what they count. Nothing of it is stored
until the evaluation is through, so that it can begin anew where somebody else was faster.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import orjson

from gateway.automation.rules.rule import Rule
from gateway.automation.rules.target_deliveries import Firing
from gateway.domain.automation.gateway_event import GatewayEvent
from gateway.domain.automation.rule import RuleState
from gateway.errors import StoreError
from gateway.store.automation.rule_states import read_states
from gateway.store.engine import StoreEngine
from metaros.automation.rules.when import State, When, at_rest, due, group_of, step, value_of
from metaros.limits import LIMITS, Limits

__all__ = [
    "Evaluation",
    "KnownState",
    "RuleCounts",
    "StateCache",
    "gateway_event_json",
    "known_state",
    "read_gateway_event",
]

log = logging.getLogger(__name__)
ERROR_CHARS = 500


class KnownState(NamedTuple):
    """A row, and what it says."""

    row: RuleState
    state: State


StateCache = dict[tuple[str, str], KnownState]


@dataclass(slots=True)
class RuleCounts:
    """What a rule did in this evaluation."""

    matched: int = 0
    fired: int = 0
    errors: int = 0
    error: str = ""


@dataclass(slots=True)
class Evaluation:
    """`known` is what a gateway remembers of former evaluations; it is read, and not written. Where it is `complete`,
    what is not in it is nowhere else.
    """

    engine: StoreEngine
    now_ns: int
    known: StateCache
    limits: Limits = LIMITS
    complete: bool = False
    changed: StateCache = field(default_factory=dict)
    firings: list[Firing] = field(default_factory=list)
    counts_by_rule: dict[str, RuleCounts] = field(default_factory=dict)
    seen: StateCache = field(default_factory=dict)

    def counts(self, rule: Rule) -> RuleCounts:
        """What the rule did so far."""
        return self.counts_by_rule.setdefault(rule.name, RuleCounts())

    def failed(self, rule: Rule, error: Exception) -> None:
        """A rule's mistake: it is counted, and ends nothing. A StoreError is no rule's mistake, and goes on."""
        if isinstance(error, StoreError):
            raise error
        counts = self.counts(rule)
        counts.errors += 1
        counts.error = f"{type(error).__name__}: {error}"[:ERROR_CHARS].replace("\0", "")
        log.debug("rule %s failed", rule.name, exc_info=error)

    def evaluate(self, rule: Rule, gateway_event: GatewayEvent, event: Mapping[str, Any], *, matched: bool) -> None:
        """An event of a rule's own: it counts, or it does not (which a condition with a memory may want to know)."""
        try:
            if matched:
                self.counts(rule).matched += 1
            if rule.when is None:
                if matched:
                    self.fire(rule, gateway_event, "")
                return
            self.step(rule, rule.when, group_of(rule.when, event), gateway_event, matched, value_of(rule.when, event))
        except Exception as error:  # whatever somebody put into a rule or an event
            self.failed(rule, error)

    def step(
        self, rule: Rule, when: When, group: str, gateway_event: GatewayEvent, matched: bool, value: float | None
    ) -> None:
        """A rule with a memory takes one more step in a group."""
        before = self.of(rule, group)
        done = step(when, before.state, matched, value, self.now_ns)
        self.keep(rule, when, group, before, done.state, done.due_ns or 0, gateway_event if matched else None)
        if done.fired:
            self.fire(rule, gateway_event, group)
        if done.ended:
            self.firings.append(
                Firing(rule=rule, gateway_event=gateway_event, group=group, now_ns=self.now_ns, ended=True)
            )

    def on_timer(self, rule: Rule, row: RuleState) -> None:
        """A rule's timer has run out in a group."""
        assert rule.when is not None
        before = self.of(rule, row.group)
        done = due(rule.when, before.state, self.now_ns)
        last = read_gateway_event(before.row.last) if before.row.last else None
        self.keep(rule, rule.when, row.group, before, done.state, done.due_ns or 0, last)
        if done.fired and last is not None:
            self.fire(rule, last, row.group, by_timer_ns=row.due_ns)

    def fire(self, rule: Rule, gateway_event: GatewayEvent, group: str, *, by_timer_ns: int = 0) -> None:
        """The rule fires."""
        self.counts(rule).fired += 1
        self.firings.append(
            Firing(rule=rule, gateway_event=gateway_event, group=group, now_ns=self.now_ns, by_timer_ns=by_timer_ns)
        )

    def of(self, rule: Rule, group: str) -> KnownState:
        """What a rule remembers of a group."""
        key = (rule.name, group)
        found = self.changed.get(key) or self.seen.get(key) or self.known.get(key)
        if found is None:
            rows = {} if self.complete else read_states(self.engine, [key])
            row = rows.get(key) or RuleState(rule=rule.name, group=group, token=rule.token, state="")
            found = known_state(row)
        if found.row.token != rule.token:  # it is of what the rule was before it was changed
            found = KnownState(replace(found.row, token=rule.token, last="", due_ns=0), State())
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
        before: KnownState,
        state: State,
        due_ns: int,
        gateway_event: GatewayEvent | None,
    ) -> None:
        """Remember a state from now on; one that says nothing is forgotten, which is `state` ""."""
        if replace(state, seen_ns=before.state.seen_ns) == before.state and due_ns == before.row.due_ns:
            return
        last = ""
        if due_ns:
            last = gateway_event_json(gateway_event, self.limits) if gateway_event is not None else before.row.last
        text = "" if at_rest(when, state, self.now_ns) else orjson.dumps(state.to_json()).decode()
        row = replace(before.row, token=rule.token, state=text, last=last, due_ns=due_ns)
        self.changed[rule.name, group] = KnownState(row, state)


def known_state(row: RuleState) -> KnownState:
    """A row, read."""
    return KnownState(row, State.from_json(orjson.loads(row.state)) if row.state else State())


def gateway_event_json(one: GatewayEvent, limits: Limits = LIMITS) -> str:
    """An event as a row keeps it; of one that is too large, what it is about."""
    text = orjson.dumps([one.id, one.type, one.source, one.at_ns, one.robot, dict(one.data)])
    if len(text) > limits.rule_payload_bytes:
        less = {"omitted": {"reason": "too_large", "size_bytes": len(text)}}
        text = orjson.dumps([one.id, one.type, one.source, one.at_ns, one.robot, less])
    return text.decode()


def read_gateway_event(text: str) -> GatewayEvent:
    """The reverse."""
    event_id, kind, source, at_ns, robot, data = orjson.loads(text)
    return GatewayEvent(id=event_id, type=kind, source=source, at_ns=at_ns, robot=robot, data=data)
