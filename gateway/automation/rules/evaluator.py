"""Evaluates the rules on what is being stored, in the same transaction: what was committed has been evaluated, and what
fired is in the queue. Everything here is on the store's writer thread.

A mistake in a rule is counted and ends nothing. A StoreError fails the transaction, as it would have without rules.
"""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

from gateway.automation.rules.evaluation import Evaluation, KnownState, RuleCounts, StateCache, known_state
from gateway.automation.rules.metric_values import evaluate_rows
from gateway.automation.rules.rule import Rule
from gateway.automation.rules.ruleset import NOTHING, Ruleset
from gateway.automation.rules.target_deliveries import FunctionPut, no_functions, target_deliveries
from gateway.automation.sample_events import SampleReader
from gateway.domain.automation.delivery import Put
from gateway.domain.automation.event import Event
from gateway.domain.automation.gateway_event import JOURNAL, GatewayEvent, from_journal
from gateway.domain.automation.rule import RuleState, RuleStats
from gateway.domain.automation.shapes import eventbridge
from gateway.errors import StoreError
from gateway.store.automation.deliveries import put
from gateway.store.automation.gateway_events import add_gateway_events
from gateway.store.automation.rule_states import all_states, forget_states, groups_of, keep_states, read_states
from gateway.store.automation.rules import add_stats
from gateway.store.engine import StoreEngine
from gateway.store.writes import StreamWrite
from metaros.clock import Clock
from metaros.errors import MetarosError
from metaros.limits import LIMITS, Limits

__all__ = ["RuleEngine"]

log = logging.getLogger(__name__)
TRIES = 4
BELIEVED_NS = 10**9  # for so long what is remembered is believed where other gateways may change it
COUNTED_NS = 10**9  # what only matched is counted so often
OWN_SOURCES = ("metaros.topic", "metaros.metric", "metaros.schedule")  # of what nothing else keeps


class RuleEngine:
    """`ruleset` is put in place from any thread; all else is the writer's."""

    def __init__(
        self,
        gateway: str,
        *,
        clock: Clock,
        function_put: FunctionPut = no_functions,
        notify: Callable[[Sequence[Put]], None] = lambda puts: None,
        limits: Limits = LIMITS,
    ) -> None:
        """`notify` hears on the writer's thread of what was put into the queue, before it is committed."""
        self.ruleset: Ruleset = NOTHING
        self.failures = 0  # evaluations that ended in a way that nobody foresaw
        self._gateway = gateway
        self._clock = clock
        self._function_put = function_put
        self._notify = notify
        self._limits = limits
        self._reader = SampleReader(limits=limits)
        self._known: StateCache | None = None  # what commits remember; None: it has to be read
        self._known_ns = 0
        self._matched: Counter[str] = Counter()
        self._counted_ns = 0

    def on_writes(self, engine: StoreEngine, fresh: Sequence[StreamWrite], now_ns: int) -> None:
        """Samples and rows that are being stored. Raises StoreError."""
        ruleset = self.ruleset
        if ruleset.on_topics or ruleset.on_metrics:
            self._run(engine, now_ns, lambda evaluation: self._judge_writes(evaluation, ruleset, fresh), kept=True)

    def on_aborted(self) -> None:
        """What was remembered of a transaction that did not happen did not happen either."""
        self._known = None

    def on_events(self, engine: StoreEngine, events: Sequence[Event]) -> None:
        """Events that are being stored in the journal. Raises StoreError."""
        if self.ruleset.on_events:
            gateway_events = [from_journal(event) for event in events]
            self.on_gateway_events(engine, gateway_events, self._clock.wall_ns())

    def on_gateway_events(self, engine: StoreEngine, gateway_events: Sequence[GatewayEvent], now_ns: int) -> None:
        """Other events that are being stored. Raises StoreError."""
        ruleset = self.ruleset
        if ruleset.on_events and gateway_events:
            self._run(engine, now_ns, lambda evaluation: _evaluate_events(evaluation, ruleset, gateway_events))

    def on_schedules(self, engine: StoreEngine, due: Sequence[tuple[Rule, GatewayEvent]], now_ns: int) -> None:
        """Schedules' times have come. Raises StoreError."""

        def evaluate(evaluation: Evaluation) -> None:
            for rule, gateway_event in due:
                evaluation.evaluate(rule, gateway_event, {}, matched=True)

        self._run(engine, now_ns, evaluate)

    def on_timers(self, engine: StoreEngine, rows: Sequence[RuleState], now_ns: int) -> None:
        """Timers have run out; those of rules that are gone, off, or something else by now are let go. StoreError."""
        rules = self.ruleset.rules
        gone = [row for row in rows if row.rule not in rules or rules[row.rule].token != row.token]
        forget_states(engine, [(row.rule, row.group) for row in gone])
        live = [row for row in rows if row not in gone]

        def evaluate(evaluation: Evaluation) -> None:
            for row in live:
                rule = rules[row.rule]
                try:
                    evaluation.on_timer(rule, row)
                except Exception as error:  # whatever is in the row: it must not ring for ever
                    evaluation.failed(rule, error)
                    forget_states(engine, [(row.rule, row.group)])

        if gone:
            self._known = None
        self._run(engine, now_ns, evaluate)

    def _judge_writes(self, evaluation: Evaluation, ruleset: Ruleset, fresh: Sequence[StreamWrite]) -> None:
        self._reader.begin()
        for write in fresh:
            if write.rows is not None and ruleset.on_metrics:
                evaluate_rows(evaluation, ruleset, write.robot, write.rows)
            elif write.run is not None and ruleset.on_topics:
                rules = ruleset.of_topic(write.robot, write.run.channel.topic)
                if rules:
                    self._judge_samples(evaluation, rules, write)

    def _judge_samples(self, evaluation: Evaluation, rules: Iterable[Rule], write: StreamWrite) -> None:
        for gateway_event in self._reader.gateway_events(write):
            event = eventbridge(gateway_event)
            for rule in rules:
                matched = rule.pattern is None or rule.pattern.matches(event)
                if matched or rule.until is None or rule.until.matches(event):
                    evaluation.evaluate(rule, gateway_event, event, matched=matched)

    def _run(
        self, engine: StoreEngine, now_ns: int, judge: Callable[[Evaluation], None], *, kept: bool = False
    ) -> None:
        """Judge, until nobody else changed meanwhile what was remembered, then store what came of it.

        `kept`: in a commit, whose end is heard of, what is remembered may be believed in the next one.
        """
        try:
            for _ in range(TRIES):
                known = self._remembered(engine, now_ns) if kept else None
                evaluation = Evaluation(engine, now_ns, known or {}, self._limits, complete=known is not None)
                judge(evaluation)
                if not engine.shared or self._agrees(engine, evaluation):
                    break
            self._store(engine, evaluation)
        except StoreError:
            raise
        except Exception:  # a mistake of ours must not keep robots' samples from being stored
            self.failures += 1
            log.exception("what is stored was not judged by the rules")
            self._known = None
            return
        self._remember(evaluation, kept)

    def _remembered(self, engine: StoreEngine, now_ns: int) -> StateCache | None:
        """All that rules remember, read once; None where that is more than there is room for."""
        if engine.shared and now_ns - self._known_ns > BELIEVED_NS:
            self._known = None
        if self._known is None:
            most = self._limits.rule_states
            rows = all_states(engine, limit=most + 1)
            if len(rows) > most:
                return None
            self._known = {(row.rule, row.group): known_state(row) for row in rows}
            self._known_ns = now_ns
        return self._known

    def _agrees(self, engine: StoreEngine, evaluation: Evaluation) -> bool:
        """Whether what the evaluation changes is as the evaluation believed; from then on nobody else changes it."""
        rows = read_states(engine, list(evaluation.changed))
        for key, item in evaluation.changed.items():
            row = rows.get(key)
            if (row.revision if row is not None else 0) != item.row.revision:
                self._known = None
                return False
        return True

    def _store(self, engine: StoreEngine, evaluation: Evaluation) -> None:
        puts: list[Put] = []
        for firing in evaluation.firings:
            try:
                puts += target_deliveries(firing, self._function_put, limits=self._limits)
            except Exception as error:  # whatever somebody put into a rule or an event
                evaluation.failed(firing.rule, error)
        self._store_events(engine, evaluation)
        try:
            put(engine, puts, gateway=self._gateway, now_ns=evaluation.now_ns, limits=self._limits)
            self._notify(puts)
        except StoreError:
            raise
        except MetarosError as error:  # the queue is full: what happened is kept, and can be delivered again later
            for rule in {firing.rule for firing in evaluation.firings}:
                evaluation.failed(rule, error)
        self._bound(engine, evaluation)
        rested = {key for key, item in evaluation.changed.items() if not item.row.state}
        lost = keep_states(engine, [item.row for key, item in evaluation.changed.items() if key not in rested])
        if lost:
            raise StoreError("another gateway changed what a rule remembers at the same moment")
        forget_states(engine, rested)
        self._count(engine, evaluation)

    def _bound(self, engine: StoreEngine, evaluation: Evaluation) -> None:
        """Of more groups than a rule may have nothing is remembered."""
        new: dict[str, list[str]] = {}
        for (rule, group), item in evaluation.changed.items():
            if item.row.state and not item.row.revision:
                new.setdefault(rule, []).append(group)
        for name, groups in new.items():
            room = max(0, self._limits.rule_groups - groups_of(engine, name))
            for group in groups[room:]:
                del evaluation.changed[name, group]
                counts = evaluation.counts_by_rule.setdefault(name, RuleCounts())
                counts.errors += 1
                counts.error = f"it has {self._limits.rule_groups} groups already"

    def _store_events(self, engine: StoreEngine, evaluation: Evaluation) -> None:
        """What set something off, where nothing else keeps it."""
        own = [firing.gateway_event for firing in evaluation.firings if firing.gateway_event.source in OWN_SOURCES]
        try:
            add_gateway_events(engine, own, gateway=self._gateway, now_ns=evaluation.now_ns)
        except StoreError:
            raise
        except MetarosError as error:
            log.warning("what set off rules is not kept for replays: %s", error)

    def _count(self, engine: StoreEngine, evaluation: Evaluation) -> None:
        """What only matched is gathered for a second, as it may be much."""
        loud = {name for name, counts in evaluation.counts_by_rule.items() if counts.fired or counts.errors}
        self._matched.update({name: counts.matched for name, counts in evaluation.counts_by_rule.items()})
        if not loud and evaluation.now_ns - self._counted_ns < COUNTED_NS:
            return
        matched, self._matched, self._counted_ns = self._matched, Counter(), evaluation.now_ns
        news = {}
        for name in loud | {name for name, count in matched.items() if count}:
            counts = evaluation.counts_by_rule.get(name, RuleCounts())
            news[name] = RuleStats(
                matched=matched[name],
                fired=counts.fired,
                errors=counts.errors,
                fired_ns=evaluation.now_ns if counts.fired else 0,
                error=counts.error,
                error_ns=evaluation.now_ns if counts.errors else 0,
            )
        add_stats(engine, self._gateway, news)

    def _remember(self, evaluation: Evaluation, kept: bool) -> None:
        if not kept or self._known is None:
            if evaluation.changed:
                self._known = None
            return
        for key, item in evaluation.changed.items():
            if item.row.state:
                self._known[key] = KnownState(replace(item.row, revision=item.row.revision + 1), item.state)
            else:
                self._known.pop(key, None)


def _evaluate_events(evaluation: Evaluation, ruleset: Ruleset, gateway_events: Sequence[GatewayEvent]) -> None:
    for gateway_event in gateway_events:
        event = eventbridge(gateway_event)
        for rule, matched in ruleset.of_event(event, gateway_event.robot).items():
            if not _own_echo(rule, gateway_event):
                evaluation.evaluate(rule, gateway_event, event, matched=matched)


def _own_echo(rule: Rule, gateway_event: GatewayEvent) -> bool:
    """Whether the rule itself did what it now hears of: it would go on for ever."""
    return gateway_event.source == JOURNAL and gateway_event.data.get("issued_by") == f"rule {rule.name}"
