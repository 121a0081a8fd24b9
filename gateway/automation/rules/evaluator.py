"""Judges what is being stored by the rules, in the very transaction that stores it: what was committed has been judged,
and what fired is in the queue. Everything here is on the store's writer thread.

A mistake in a rule is counted and ends nothing. A StoreError fails the transaction, as it would have without rules.
"""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

from gateway.domain.delivery import Put
from gateway.domain.event import Event
from gateway.domain.happening import JOURNAL, Happening, journal_happening
from gateway.domain.rule import RuleState, RuleStats
from gateway.domain.shapes import eventbridge
from gateway.errors import StoreError
from gateway.rules.firing import FunctionPut, no_functions, puts_of
from gateway.rules.metric_values import judge_rows
from gateway.rules.rule import Rule
from gateway.rules.ruleset import NOTHING, Ruleset
from gateway.rules.turn import Known, Remembered, Tally, Turn, remembered
from gateway.sample_happenings import SampleReader
from gateway.store.deliveries import put
from gateway.store.engine import StoreEngine
from gateway.store.happenings import add_happenings
from gateway.store.rule_states import all_states, forget_states, groups_of, keep_states, read_states
from gateway.store.rules import add_stats
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
        noted: Callable[[Sequence[Put]], None] = lambda puts: None,
        limits: Limits = LIMITS,
    ) -> None:
        """`noted` hears on the writer's thread of what was put into the queue, before it is committed."""
        self.ruleset: Ruleset = NOTHING
        self.failures = 0  # evaluations that ended in a way that nobody foresaw
        self._gateway = gateway
        self._clock = clock
        self._function_put = function_put
        self._noted = noted
        self._limits = limits
        self._reader = SampleReader(limits=limits)
        self._known: Known | None = None  # what commits remember; None: it has to be read
        self._known_ns = 0
        self._matched: Counter[str] = Counter()
        self._counted_ns = 0

    def on_writes(self, engine: StoreEngine, fresh: Sequence[StreamWrite], now_ns: int) -> None:
        """Samples and rows that are being stored. Raises StoreError."""
        ruleset = self.ruleset
        if ruleset.on_topics or ruleset.on_metrics:
            self._run(engine, now_ns, lambda turn: self._judge_writes(turn, ruleset, fresh), kept=True)

    def on_aborted(self) -> None:
        """What was remembered of a transaction that did not happen did not happen either."""
        self._known = None

    def on_events(self, engine: StoreEngine, events: Sequence[Event]) -> None:
        """Events that are being stored in the journal. Raises StoreError."""
        if self.ruleset.on_events:
            happenings = [journal_happening(event) for event in events]
            self.on_happenings(engine, happenings, self._clock.wall_ns())

    def on_happenings(self, engine: StoreEngine, happenings: Sequence[Happening], now_ns: int) -> None:
        """Other happenings that are being stored. Raises StoreError."""
        ruleset = self.ruleset
        if ruleset.on_events and happenings:
            self._run(engine, now_ns, lambda turn: _judge_happenings(turn, ruleset, happenings))

    def on_schedules(self, engine: StoreEngine, due: Sequence[tuple[Rule, Happening]], now_ns: int) -> None:
        """Schedules' times have come. Raises StoreError."""

        def judge(turn: Turn) -> None:
            for rule, happening in due:
                turn.judge(rule, happening, {}, matched=True)

        self._run(engine, now_ns, judge)

    def on_timers(self, engine: StoreEngine, rows: Sequence[RuleState], now_ns: int) -> None:
        """Timers have run out; those of rules that are gone, off, or something else by now are let go. StoreError."""
        rules = self.ruleset.rules
        gone = [row for row in rows if row.rule not in rules or rules[row.rule].token != row.token]
        forget_states(engine, [(row.rule, row.group) for row in gone])
        live = [row for row in rows if row not in gone]

        def judge(turn: Turn) -> None:
            for row in live:
                rule = rules[row.rule]
                try:
                    turn.ring(rule, row)
                except Exception as error:  # whatever is in the row: it must not ring for ever
                    turn.failed(rule, error)
                    forget_states(engine, [(row.rule, row.group)])

        if gone:
            self._known = None
        self._run(engine, now_ns, judge)

    def _judge_writes(self, turn: Turn, ruleset: Ruleset, fresh: Sequence[StreamWrite]) -> None:
        self._reader.begin()
        for write in fresh:
            if write.rows is not None and ruleset.on_metrics:
                judge_rows(turn, ruleset, write.robot, write.rows)
            elif write.run is not None and ruleset.on_topics:
                rules = ruleset.of_topic(write.robot, write.run.channel.topic)
                if rules:
                    self._judge_samples(turn, rules, write)

    def _judge_samples(self, turn: Turn, rules: Iterable[Rule], write: StreamWrite) -> None:
        for happening in self._reader.happenings(write):
            event = eventbridge(happening)
            for rule in rules:
                matched = rule.pattern is None or rule.pattern.matches(event)
                if matched or rule.until is None or rule.until.matches(event):
                    turn.judge(rule, happening, event, matched=matched)

    def _run(self, engine: StoreEngine, now_ns: int, judge: Callable[[Turn], None], *, kept: bool = False) -> None:
        """Judge, until nobody else changed meanwhile what was remembered, then store what came of it.

        `kept`: in a commit, whose end is heard of, what is remembered may be believed in the next one.
        """
        try:
            for _ in range(TRIES):
                known = self._remembered(engine, now_ns) if kept else None
                turn = Turn(engine, now_ns, known or {}, self._limits, complete=known is not None)
                judge(turn)
                if not engine.shared or self._agrees(engine, turn):
                    break
            self._store(engine, turn)
        except StoreError:
            raise
        except Exception:  # a mistake of ours must not keep robots' samples from being stored
            self.failures += 1
            log.exception("what is stored was not judged by the rules")
            self._known = None
            return
        self._remember(turn, kept)

    def _remembered(self, engine: StoreEngine, now_ns: int) -> Known | None:
        """All that rules remember, read once; None where that is more than there is room for."""
        if engine.shared and now_ns - self._known_ns > BELIEVED_NS:
            self._known = None
        if self._known is None:
            most = self._limits.rule_states
            rows = all_states(engine, limit=most + 1)
            if len(rows) > most:
                return None
            self._known = {(row.rule, row.group): remembered(row) for row in rows}
            self._known_ns = now_ns
        return self._known

    def _agrees(self, engine: StoreEngine, turn: Turn) -> bool:
        """Whether what the turn changes is as the turn believed; from then on nobody else changes it."""
        rows = read_states(engine, list(turn.changed))
        for key, item in turn.changed.items():
            row = rows.get(key)
            if (row.revision if row is not None else 0) != item.row.revision:
                self._known = None
                return False
        return True

    def _store(self, engine: StoreEngine, turn: Turn) -> None:
        puts: list[Put] = []
        for firing in turn.firings:
            try:
                puts += puts_of(firing, self._function_put, limits=self._limits)
            except Exception as error:  # whatever somebody put into a rule or an event
                turn.failed(firing.rule, error)
        self._store_happenings(engine, turn)
        try:
            put(engine, puts, gateway=self._gateway, now_ns=turn.now_ns, limits=self._limits)
            self._noted(puts)
        except StoreError:
            raise
        except MetarosError as error:  # the queue is full: what happened is kept, and can be delivered again later
            for rule in {firing.rule for firing in turn.firings}:
                turn.failed(rule, error)
        self._bound(engine, turn)
        rested = {key for key, item in turn.changed.items() if not item.row.state}
        lost = keep_states(engine, [item.row for key, item in turn.changed.items() if key not in rested])
        if lost:
            raise StoreError("another gateway changed what a rule remembers at the same moment")
        forget_states(engine, rested)
        self._count(engine, turn)

    def _bound(self, engine: StoreEngine, turn: Turn) -> None:
        """Of more groups than a rule may have nothing is remembered."""
        new: dict[str, list[str]] = {}
        for (rule, group), item in turn.changed.items():
            if item.row.state and not item.row.revision:
                new.setdefault(rule, []).append(group)
        for name, groups in new.items():
            room = max(0, self._limits.rule_groups - groups_of(engine, name))
            for group in groups[room:]:
                del turn.changed[name, group]
                tally = turn.tallies.setdefault(name, Tally())
                tally.errors += 1
                tally.error = f"it has {self._limits.rule_groups} groups already"

    def _store_happenings(self, engine: StoreEngine, turn: Turn) -> None:
        """What set something off, where nothing else keeps it."""
        own = [firing.happening for firing in turn.firings if firing.happening.source in OWN_SOURCES]
        try:
            add_happenings(engine, own, gateway=self._gateway, now_ns=turn.now_ns)
        except StoreError:
            raise
        except MetarosError as error:
            log.warning("what set off rules is not kept for replays: %s", error)

    def _count(self, engine: StoreEngine, turn: Turn) -> None:
        """What only matched is gathered for a second, as it may be much."""
        loud = {name for name, tally in turn.tallies.items() if tally.fired or tally.errors}
        self._matched.update({name: tally.matched for name, tally in turn.tallies.items()})
        if not loud and turn.now_ns - self._counted_ns < COUNTED_NS:
            return
        matched, self._matched, self._counted_ns = self._matched, Counter(), turn.now_ns
        news = {}
        for name in loud | {name for name, count in matched.items() if count}:
            tally = turn.tallies.get(name, Tally())
            news[name] = RuleStats(
                matched=matched[name],
                fired=tally.fired,
                errors=tally.errors,
                fired_ns=turn.now_ns if tally.fired else 0,
                error=tally.error,
                error_ns=turn.now_ns if tally.errors else 0,
            )
        add_stats(engine, self._gateway, news)

    def _remember(self, turn: Turn, kept: bool) -> None:
        if not kept or self._known is None:
            if turn.changed:
                self._known = None
            return
        for key, item in turn.changed.items():
            if item.row.state:
                self._known[key] = Remembered(replace(item.row, revision=item.row.revision + 1), item.state)
            else:
                self._known.pop(key, None)


def _judge_happenings(turn: Turn, ruleset: Ruleset, happenings: Sequence[Happening]) -> None:
    for happening in happenings:
        event = eventbridge(happening)
        for rule, matched in ruleset.of_event(event, happening.robot).items():
            if not _own_echo(rule, happening):
                turn.judge(rule, happening, event, matched=matched)


def _own_echo(rule: Rule, happening: Happening) -> bool:
    """Whether the rule itself did what it now hears of: it would go on for ever."""
    return happening.source == JOURNAL and happening.data.get("issued_by") == f"rule {rule.name}"
