"""What a rule would have done: judged by the very code that judges what comes, over what is stored of the past.

Nothing is written. Time is the events' own here, as nobody knows any more when each of them was stored. One runs at
a time, for a bounded time and over a bounded number of rows; what was left out is said. Judging is off the event loop.
"""

from __future__ import annotations

import asyncio
import heapq
from collections.abc import AsyncIterator, Iterable
from dataclasses import dataclass, field, replace
from typing import Any, cast

from gateway.automation.rules.dry_sources import History, gateway_events, samples, schedule, values
from gateway.automation.rules.evaluation import Evaluation, KnownState
from gateway.automation.rules.metric_event import series_group
from gateway.automation.rules.rule import Rule
from gateway.automation.rules.ruleset import Ruleset
from gateway.automation.rules.target_deliveries import payload_of
from gateway.domain.automation.gateway_event import GatewayEvent
from gateway.domain.automation.rule import RuleState
from gateway.domain.automation.shapes import SHAPES, eventbridge
from gateway.store.engine import StoreEngine
from metaros.automation.rules.when import State, group_of
from metaros.clock import Clock
from metaros.limits import LIMITS, Limits

__all__ = ["DryFiring", "DryRun", "DryRunner"]

TOGETHER = 512  # events that are judged before others have a turn


@dataclass(frozen=True, slots=True, kw_only=True)
class DryFiring:
    """The rule would have fired; `payloads` are what each target would have got, by its id."""

    at_ns: int
    event_id: str
    type: str
    robot: str
    group: str
    payloads: tuple[tuple[str, str, bytes], ...]  # target, kind, payload


@dataclass(slots=True, kw_only=True)
class DryRun:
    """What came of it. `cut` says that there was more to look at, or to tell, than a dry run may."""

    scanned: int = 0
    matched: int = 0
    fired: int = 0
    errors: int = 0
    error: str = ""
    cut: bool = False
    firings: list[DryFiring] = field(default_factory=list)


class _TrialEvaluation(Evaluation):
    """An evaluation that remembers in memory alone."""

    def of(self, rule: Rule, group: str) -> KnownState:
        """What was remembered in this trial."""
        fresh = RuleState(rule=rule.name, group=group, token=rule.token, state="")
        return self.changed.get((rule.name, group)) or KnownState(fresh, State())


class DryRunner:
    """Runs them, one at a time."""

    def __init__(self, history: object, *, clock: Clock, limits: Limits = LIMITS) -> None:
        self._history = cast(History, history)
        self._clock = clock
        self._limits = limits
        self._turn = asyncio.Lock()

    async def run(self, rule: Rule, *, from_ns: int, until_ns: int, most_firings: int) -> DryRun:
        """What the rule would have done from a time up to another. Raises StoreError."""
        async with self._turn:
            trial = _RuleTrial(rule, min(most_firings, self._limits.rule_dry_firings), self._limits)
            began_s = self._clock.monotonic_s()
            some: list[GatewayEvent] = []
            async for gateway_event in self._source(rule, from_ns, until_ns):
                some.append(gateway_event)
                if len(some) >= TOGETHER:
                    await asyncio.to_thread(trial.evaluate, some)
                    some = []
                    late = self._clock.monotonic_s() - began_s > self._limits.rule_dry_s
                    if late or trial.done.scanned >= self._limits.rule_dry_rows:
                        trial.done.cut = True
                        break
            await asyncio.to_thread(trial.evaluate, some)
            if not trial.done.cut:
                await asyncio.to_thread(trial.elapse, until_ns)
            return trial.result()

    def _source(self, rule: Rule, from_ns: int, until_ns: int) -> AsyncIterator[GatewayEvent]:
        if rule.topic is not None:
            return samples(self._history, rule, from_ns, until_ns, self._limits)
        if rule.metric is not None:
            return values(self._history, rule, from_ns, until_ns, self._limits)
        if rule.schedule is not None:
            return schedule(rule, from_ns, until_ns)
        return gateway_events(self._history, from_ns, until_ns)


class _RuleTrial:
    """One rule, on a thread."""

    def __init__(self, rule: Rule, most: int, limits: Limits) -> None:
        self.done = DryRun()
        self._rule = rule
        self._most = most
        self._ruleset = Ruleset([replace(rule, enabled=True)])  # one that is off is tried as if it were on
        self._evaluation = _TrialEvaluation(cast(StoreEngine, None), 0, {}, limits)
        self._timers: list[tuple[int, str]] = []
        self._limits = limits

    def evaluate(self, some: Iterable[GatewayEvent]) -> None:
        """Events, the oldest first."""
        for gateway_event in some:
            self.done.scanned += 1
            self.elapse(gateway_event.at_ns)
            self._evaluation.now_ns = gateway_event.at_ns
            event = eventbridge(gateway_event)
            if self._rule.metric is not None:
                self._value(gateway_event, event)
            elif (matched := self._matches(gateway_event, event)) is not None:
                self._evaluation.evaluate(self._rule, gateway_event, event, matched=matched)
                self._look(group_of(self._rule.when, event) if self._rule.when is not None else "")
            self._report()

    def _value(self, gateway_event: GatewayEvent, event: dict[str, Any]) -> None:
        """A value of a series, as gateway/automation/rules/metric_values.py has it."""
        rule, value = self._rule, float(gateway_event.data["value"])
        assert rule.metric is not None
        assert rule.when is not None
        beyond = rule.metric.beyond(value) and (rule.pattern is None or rule.pattern.matches(event))
        group = series_group(rule, gateway_event.robot, gateway_event.data["series"])
        self._evaluation.counts(rule).matched += beyond
        self._evaluation.step(rule, rule.when, group, gateway_event, beyond or rule.when.hysteresis is not None, value)
        self._look(group)

    def elapse(self, until_ns: int) -> None:
        """Timers that run out by then."""
        while self._timers and self._timers[0][0] <= until_ns:
            due_ns, group = heapq.heappop(self._timers)
            row = self._evaluation.of(self._rule, group).row
            if row.due_ns == due_ns:
                self._evaluation.now_ns = due_ns
                self._evaluation.on_timer(self._rule, row)
                self._look(group)
                self._report()

    def result(self) -> DryRun:
        """All of it."""
        counts = self._evaluation.counts_by_rule.get(self._rule.name)
        if counts is not None:
            self.done.matched, self.done.fired = counts.matched, counts.fired
            self.done.errors, self.done.error = self.done.errors + counts.errors, counts.error or self.done.error
        return self.done

    def _matches(self, gateway_event: GatewayEvent, event: dict[str, Any]) -> bool | None:
        """Whether it counts, or ends what is waited for; None: it is not for the rule."""
        rule = self._rule
        if rule.schedule is not None:
            return True
        if rule.topic is None:
            return next(iter(self._ruleset.of_event(event, gateway_event.robot).values()), None)
        matched = rule.pattern is None or rule.pattern.matches(event)
        return matched if matched or rule.until is None or rule.until.matches(event) else None

    def _look(self, group: str) -> None:
        """Wind the clock of a group."""
        row = self._evaluation.of(self._rule, group).row
        if row.due_ns:
            heapq.heappush(self._timers, (row.due_ns, group))

    def _report(self) -> None:
        for firing in self._evaluation.firings:
            if firing.ended:
                continue
            if len(self.done.firings) >= self._most:
                self.done.cut = True
                break
            try:
                self.done.firings.append(self._reported(firing.gateway_event, firing.group, firing.now_ns))
            except ValueError as error:
                self.done.errors += 1
                self.done.error = str(error)
        self._evaluation.firings.clear()

    def _reported(self, gateway_event: GatewayEvent, group: str, at_ns: int) -> DryFiring:
        event = SHAPES[self._rule.event_format](gateway_event)
        payloads = tuple(
            (target.id, target.kind, payload_of(self._rule, target, event, limits=self._limits))
            for target in self._rule.targets
        )
        return DryFiring(
            at_ns=at_ns,
            event_id=gateway_event.id,
            type=gateway_event.type,
            robot=gateway_event.robot,
            group=group,
            payloads=payloads,
        )
