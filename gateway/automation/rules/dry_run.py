"""What a rule would have done: judged by the very code that judges what comes, over what is stored of the past.

Nothing is written. Time is the happenings' own here, as nobody knows any more when each of them was stored. One runs at
a time, for a bounded time and over a bounded number of rows; what was left out is said. Judging is off the event loop.
"""

from __future__ import annotations

import asyncio
import heapq
from collections.abc import AsyncIterator, Iterable
from dataclasses import dataclass, field, replace
from typing import Any, cast

from gateway.domain.happening import Happening
from gateway.domain.rule import RuleState
from gateway.domain.shapes import SHAPES, eventbridge
from gateway.rules.dry_sources import History, happenings, samples, schedule, values
from gateway.rules.firing import payload_of
from gateway.rules.metric_happening import series_group
from gateway.rules.rule import Rule
from gateway.rules.ruleset import Ruleset
from gateway.rules.turn import Remembered, Turn
from gateway.store.engine import StoreEngine
from metaros.clock import Clock
from metaros.limits import LIMITS, Limits
from metaros.rules.when import State, group_of

__all__ = ["DryFiring", "DryRun", "DryRunner"]

TOGETHER = 512  # happenings that are judged before others have a turn


@dataclass(frozen=True, slots=True, kw_only=True)
class DryFiring:
    """The rule would have fired; `payloads` are what each target would have got, by its id."""

    at_ns: int
    happening: str
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


class _Trial(Turn):
    """A turn that remembers in memory alone."""

    def of(self, rule: Rule, group: str) -> Remembered:
        """What was remembered in this trial."""
        fresh = RuleState(rule=rule.name, group=group, token=rule.token, state="")
        return self.changed.get((rule.name, group)) or Remembered(fresh, State())


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
            judge = _Judge(rule, min(most_firings, self._limits.rule_dry_firings), self._limits)
            began_s = self._clock.monotonic_s()
            some: list[Happening] = []
            async for happening in self._source(rule, from_ns, until_ns):
                some.append(happening)
                if len(some) >= TOGETHER:
                    await asyncio.to_thread(judge.judge, some)
                    some = []
                    late = self._clock.monotonic_s() - began_s > self._limits.rule_dry_s
                    if late or judge.done.scanned >= self._limits.rule_dry_rows:
                        judge.done.cut = True
                        break
            await asyncio.to_thread(judge.judge, some)
            if not judge.done.cut:
                await asyncio.to_thread(judge.elapse, until_ns)
            return judge.result()

    def _source(self, rule: Rule, from_ns: int, until_ns: int) -> AsyncIterator[Happening]:
        if rule.topic is not None:
            return samples(self._history, rule, from_ns, until_ns, self._limits)
        if rule.metric is not None:
            return values(self._history, rule, from_ns, until_ns, self._limits)
        if rule.schedule is not None:
            return schedule(rule, from_ns, until_ns)
        return happenings(self._history, from_ns, until_ns)


class _Judge:
    """One rule, on a thread."""

    def __init__(self, rule: Rule, most: int, limits: Limits) -> None:
        self.done = DryRun()
        self._rule = rule
        self._most = most
        self._ruleset = Ruleset([replace(rule, enabled=True)])  # one that is off is tried as if it were on
        self._trial = _Trial(cast(StoreEngine, None), 0, {}, limits)
        self._timers: list[tuple[int, str]] = []
        self._limits = limits

    def judge(self, some: Iterable[Happening]) -> None:
        """Happenings, the oldest first."""
        for happening in some:
            self.done.scanned += 1
            self.elapse(happening.at_ns)
            self._trial.now_ns = happening.at_ns
            event = eventbridge(happening)
            if self._rule.metric is not None:
                self._value(happening, event)
            elif (matched := self._matches(happening, event)) is not None:
                self._trial.judge(self._rule, happening, event, matched=matched)
                self._look(group_of(self._rule.when, event) if self._rule.when is not None else "")
            self._tell()

    def _value(self, happening: Happening, event: dict[str, Any]) -> None:
        """A value of a series, as gateway/rules/metric_values.py has it."""
        rule, value = self._rule, float(happening.data["value"])
        assert rule.metric is not None
        assert rule.when is not None
        beyond = rule.metric.beyond(value) and (rule.pattern is None or rule.pattern.matches(event))
        group = series_group(rule, happening.robot, happening.data["series"])
        self._trial.tally(rule).matched += beyond
        self._trial.step(rule, rule.when, group, happening, beyond or rule.when.hysteresis is not None, value)
        self._look(group)

    def elapse(self, until_ns: int) -> None:
        """Timers that run out by then."""
        while self._timers and self._timers[0][0] <= until_ns:
            due_ns, group = heapq.heappop(self._timers)
            row = self._trial.of(self._rule, group).row
            if row.due_ns == due_ns:
                self._trial.now_ns = due_ns
                self._trial.ring(self._rule, row)
                self._look(group)
                self._tell()

    def result(self) -> DryRun:
        """All of it."""
        tally = self._trial.tallies.get(self._rule.name)
        if tally is not None:
            self.done.matched, self.done.fired = tally.matched, tally.fired
            self.done.errors, self.done.error = self.done.errors + tally.errors, tally.error or self.done.error
        return self.done

    def _matches(self, happening: Happening, event: dict[str, Any]) -> bool | None:
        """Whether it counts, or ends what is waited for; None: it is not for the rule."""
        rule = self._rule
        if rule.schedule is not None:
            return True
        if rule.topic is None:
            return next(iter(self._ruleset.of_event(event, happening.robot).values()), None)
        matched = rule.pattern is None or rule.pattern.matches(event)
        return matched if matched or rule.until is None or rule.until.matches(event) else None

    def _look(self, group: str) -> None:
        """Wind the clock of a group."""
        row = self._trial.of(self._rule, group).row
        if row.due_ns:
            heapq.heappush(self._timers, (row.due_ns, group))

    def _tell(self) -> None:
        for firing in self._trial.firings:
            if firing.ended:
                continue
            if len(self.done.firings) >= self._most:
                self.done.cut = True
                break
            try:
                self.done.firings.append(self._told(firing.happening, firing.group, firing.now_ns))
            except ValueError as error:
                self.done.errors += 1
                self.done.error = str(error)
        self._trial.firings.clear()

    def _told(self, happening: Happening, group: str, at_ns: int) -> DryFiring:
        event = SHAPES[self._rule.event_format](happening)
        payloads = tuple(
            (target.id, target.kind, payload_of(self._rule, target, event, limits=self._limits))
            for target in self._rule.targets
        )
        return DryFiring(
            at_ns=at_ns,
            happening=happening.id,
            type=happening.type,
            robot=happening.robot,
            group=group,
            payloads=payloads,
        )
