"""Fires schedules, and timers of rules with a memory. One gateway of a store is on duty.

When each schedule fires next is stored, and so is what a timer waits for; to fire is one transaction with the delivery
that follows. Whoever comes on duty, after a crash too, goes on where the last one was. All methods on the event loop.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Mapping

from gateway.automation.rules.evaluator import RuleEngine
from gateway.automation.rules.registry import Database, RuleRegistry
from gateway.automation.rules.rule import Rule
from gateway.domain.automation.gateway_event import SCHEDULE, GatewayEvent
from gateway.domain.automation.rule import NextFire
from gateway.domain.automation.shapes import moment
from gateway.errors import StoreError
from gateway.store.automation.rule_states import due_states, next_fires, write_fires
from gateway.store.engine import StoreEngine
from gateway.store.fleet.updates import take_duty
from metaros.clock import Clock
from metaros.limits import LIMITS, Limits

__all__ = ["RuleScheduler", "missed"]

log = logging.getLogger(__name__)

DUTY, DUTY_S = "rules", 10.0
LOOK_S = 0.25
BATCH = 256
LATE_NS = 60 * 10**9  # what is so late was missed


class RuleScheduler:
    """`step` does what is due now; `run` does that until cancelled."""

    def __init__(
        self,
        database: Database,
        registry: RuleRegistry,
        engine: RuleEngine,
        *,
        clock: Clock,
        limits: Limits = LIMITS,
    ) -> None:
        self._database = database
        self._registry = registry
        self._engine = engine
        self._clock = clock
        self._limits = limits
        self._arranged = False
        self._duty_s = -DUTY_S
        self.on_duty = False
        registry.listeners.append(self._rearrange)

    async def run(self) -> None:
        """Until cancelled."""
        while True:
            try:
                while await self.step():
                    pass
            except StoreError as error:
                log.debug("schedules and timers wait for the store: %s", error)
            except Exception:  # whatever is wrong with a rule, the others go on
                log.exception("schedules and timers failed: a mistake of ours")
            await asyncio.sleep(LOOK_S)

    async def step(self) -> bool:
        """Do what is due, some of it at least; whether there may be more. Raises StoreError."""
        if not await self._take_duty():
            return False
        if not self._arranged:
            self._arranged = True  # first: what changes meanwhile arranges anew
            try:
                await self._arrange()
            except BaseException:
                self._arranged = False
                raise
        if not self._registry.rules():  # most gateways have none, and need not ask their store four times a second
            return False
        now_ns = self._clock.wall_ns()
        fires, timers = await self._due(now_ns)
        return (fires and await self._fire_schedules(now_ns)) | (timers and await self._fire_timers(now_ns))

    async def next_fires(self) -> dict[str, NextFire]:
        """When each rule's schedule fires next, and fired last."""

        def job(engine: StoreEngine) -> list[NextFire]:
            with engine.transaction(write=False):
                return next_fires(engine)

        return {one.rule: one for one in await self._database.read(job)}

    def _rearrange(self) -> None:
        self._arranged = False

    async def _take_duty(self) -> bool:
        """A store of one's own needs no leader election."""
        if not self._database.shared:
            self.on_duty = True
            return True
        now_s = self._clock.monotonic_s()
        if now_s - self._duty_s < DUTY_S / 3:
            return self.on_duty
        holder, now_ns, for_ns = self._database.gateway_id, self._clock.wall_ns(), round(DUTY_S * 1e9)
        before = self.on_duty
        self.on_duty = False
        self.on_duty = await self._database.run(
            lambda engine: take_duty(engine, DUTY, holder, now_ns=now_ns, for_ns=for_ns)
        )
        self._duty_s = now_s
        if self.on_duty and not before:
            self._arranged = False
        return self.on_duty

    async def _arrange(self) -> None:
        """Every schedule that is new, or another one than before, counts from now on; what is off never fires."""
        rules = {rule.name: rule for rule in self._registry.rules() if rule.schedule is not None}
        now_ns = self._clock.wall_ns()

        def job(engine: StoreEngine) -> None:
            known = {one.rule: one for one in next_fires(engine)}
            write_fires(engine, _changed(rules, known, now_ns))

        await self._database.run(job)

    async def _due(self, now_ns: int) -> tuple[bool, bool]:
        """Whether a schedule is, and whether a timer is: a look before a write transaction is begun."""
        sqls = (
            "SELECT 1 FROM rule_fires WHERE next_ns > 0 AND next_ns <= ? LIMIT 1",
            "SELECT 1 FROM rule_states WHERE due_ns > 0 AND due_ns <= ? LIMIT 1",
        )

        def job(engine: StoreEngine) -> tuple[bool, bool]:
            with engine.transaction(write=False):
                fires, timers = (bool(engine.fetch(sql, now_ns)) for sql in sqls)
                return fires, timers

        return await self._database.read(job)

    async def _fire_schedules(self, now_ns: int) -> bool:
        most = self._limits.rule_catch_up

        def job(engine: StoreEngine) -> int:
            rules = self._engine.ruleset.rules
            found = next_fires(engine, until_ns=now_ns, limit=BATCH)
            due: list[tuple[Rule, GatewayEvent]] = []
            kept: list[NextFire] = []
            for one in found:
                rule = rules.get(one.rule)
                if rule is None or rule.schedule is None or rule.token != one.token:
                    kept.append(NextFire(rule=one.rule, token="", next_ns=0, last_ns=one.last_ns))
                    continue
                times, following = missed(rule, one.next_ns, now_ns, most=most)
                due += [(rule, _scheduled(rule, at_ns, now_ns)) for at_ns in times]
                last_ns = times[-1] if times else one.last_ns
                kept.append(NextFire(rule=one.rule, token=one.token, next_ns=following, last_ns=last_ns))
            self._engine.on_schedules(engine, due, now_ns)
            write_fires(engine, kept)
            return len(found)

        return await self._database.run(job) == BATCH

    async def _fire_timers(self, now_ns: int) -> bool:
        def job(engine: StoreEngine) -> int:
            rows = due_states(engine, now_ns=now_ns, limit=BATCH)
            self._engine.on_timers(engine, rows, now_ns)
            return len(rows)

        return await self._database.run(job) == BATCH


def missed(rule: Rule, first_ns: int, now_ns: int, *, most: int) -> tuple[list[int], int]:
    """Which of a schedule's times from `first_ns` up to now it fires for, and its next one after now (0: none).

    What is no more than a minute late was not missed. Of what was, `skip` fires for none, `once` for the first, `all`
    for the first `most`.
    """
    source = rule.schedule
    assert source is not None
    room = {"skip": 0, "once": 1, "all": most}[source.misfire]
    times: list[int] = []
    at_ns: int | None = first_ns
    while at_ns is not None and at_ns <= now_ns:
        if now_ns - at_ns > LATE_NS and len(times) >= room:  # past them in one step: there may be years of minutes
            at_ns = source.schedule.next_after(max(at_ns, now_ns - LATE_NS - 1))
        else:
            times.append(at_ns)
            at_ns = source.schedule.next_after(at_ns)
    return times, at_ns or 0


def _changed(rules: Mapping[str, Rule], known: Mapping[str, NextFire], now_ns: int) -> list[NextFire]:
    rows: list[NextFire] = []
    for name, rule in rules.items():
        one = known.get(name)
        token = rule.token if rule.enabled else ""
        if (one is None or one.token != token) and rule.schedule is not None:
            following = (rule.schedule.schedule.next_after(now_ns) or 0) if rule.enabled else 0
            last_ns = one.last_ns if one is not None else 0
            rows.append(NextFire(rule=name, token=token, next_ns=following, last_ns=last_ns))
    return rows


def _scheduled(rule: Rule, at_ns: int, now_ns: int) -> GatewayEvent:
    """A schedule's time; its id is of the nominal one, so that it is once only."""
    source = rule.schedule
    assert source is not None
    return GatewayEvent(
        id=f"{rule.name}/{moment(at_ns, 'seconds')}",
        type=SCHEDULE,
        source="metaros.schedule",
        at_ns=at_ns,
        data={"rule": rule.name, "expression": source.expression, "late_s": max(0.0, (now_ns - at_ns) / 1e9)},
    )
