"""Keeps the registry in memory and the alerts in the store in step, in both directions.

The store is the truth, and listeners get nothing that is not stored. With other gateways on the store the registry
reads once a second what they changed; of two who change one alert at once the second merges. All methods on the event
loop.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable, Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any, Protocol, TypeVar

from gateway.alerting.alerts.change import Change
from gateway.alerting.alerts.config import AlertConfig
from gateway.alerting.alerts.registry import AlertRegistry
from gateway.alerting.alerts.summary import event_of
from gateway.domain.alert import Alert, Silence
from gateway.errors import StoreError, UnstorableError
from gateway.store.alerting import alerts as table
from gateway.store.alerting import remarks as talk
from gateway.store.engine import StoreEngine
from metaros.clock import Clock
from metaros.limits import Limits

__all__ = ["Database", "StoreSync"]

log = logging.getLogger(__name__)
Result = TypeVar("Result")

BATCH = 64  # alerts of one commit, told in one piece
GATHER_S = 0.02  # for which changes wait for others
LOOK_S = 1.0  # at what other gateways changed
PURGE_EVERY_S = 60.0


class Database(Protocol):
    """What is needed of the store."""

    @property
    def shared(self) -> bool:
        """Whether other gateways write to it."""

    @property
    def gateway_id(self) -> str:
        """Who writes here."""

    async def run(self, job: Callable[[StoreEngine], Result]) -> Result:
        """A job in one write transaction."""

    async def read(self, job: Callable[[StoreEngine], Result]) -> Result:
        """A job that reads, in a transaction of its own making."""


class StoreSync:
    """Start it, let `run` run; who changed the registry calls `changed`."""

    def __init__(
        self,
        database: Database,
        *,
        clock: Clock,
        emit: Callable[[str, str, Mapping[str, Any]], None] | None,
        limits: Limits,
        config: AlertConfig,
        topics_of: Callable[[str, str], Collection[str]],
    ) -> None:
        self.registry = AlertRegistry(gateway=database.gateway_id, limits=limits, config=config, topics_of=topics_of)
        self.listeners: list[Callable[[str, Alert], None]] = []
        self.watchers: list[Callable[[str], None]] = []
        self._database = database
        self._clock = clock
        self._emit = emit
        self._limits = limits
        self._config = config
        self._lock = asyncio.Lock()  # one of us at the store at a time, so that the registry knows what is there
        self._wake = asyncio.Event()
        self._trouble = ""

    async def start(self, *, adopt: bool) -> None:
        """Know the alerts of the store; with `adopt` wait for this gateway's findings to be told again. StoreError."""
        now_ns = self._clock.wall_ns()
        since_ns = now_ns - round(self._config.cooldown_s * 1e9)
        most = 2 * self._limits.alerts_unresolved

        def job(engine: StoreEngine) -> tuple[list[Alert], list[Silence]]:
            found = table.live_alerts(engine, resolved_after_ns=since_ns, limit=most)
            return found, talk.current_silences(engine, now_ns=now_ns)

        found, silences = await self.read(job)
        for alert in found:
            self.registry.learn(alert, now_ns)
        for robot in {alert.robot for alert in found if self._is_ours(alert)}:
            if adopt or not robot:  # the fleet's are nobody's robot
                self.registry.adopt(robot, now_ns)
        self.registry.silence(silences, now_ns)

    async def run(self) -> None:
        """Until cancelled."""
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(self._tick_all())
            tasks.create_task(self._save_all())
            tasks.create_task(self._purge_all())
            if self._database.shared:
                tasks.create_task(self._look_all())

    async def close(self) -> None:
        """Store what waits, if the store takes it."""
        try:
            await self.save(all_of_it=True)
        except StoreError as error:
            log.warning("the last changes of alerts are not kept: %s", error)

    def changed(self) -> None:
        """Something in the registry may have to be stored."""
        self._wake.set()

    async def write(self, job: Callable[[StoreEngine], Result], learn: Callable[[Result], None]) -> Result:
        """Change alerts or silences in the store, and let the registry know before anybody else changes them."""
        async with self._lock:
            done = await self._database.run(job)
            learn(done)
        self._wake.set()
        return done

    async def save(self, *, all_of_it: bool = False) -> None:
        """Store what changed, and tell it. Raises StoreError, and then it is a change still."""
        while await self._save_some(all_of_it=all_of_it):
            pass

    async def refresh(self) -> None:
        """Learn what other gateways changed. Raises StoreError."""
        async with self._lock:
            now_ns, known = self._clock.wall_ns(), self.registry.revisions()

            def job(engine: StoreEngine) -> tuple[list[str], list[Alert], list[Silence]]:
                stored = table.alert_revisions(engine)
                asked = [key for key in known.keys() | stored.keys() if stored.get(key) != known.get(key)]
                return asked, table.read_alerts(engine, asked), talk.current_silences(engine, now_ns=now_ns)

            asked, found, silences = await self.read(job)
            for alert in found:
                self.registry.learn(alert, now_ns)
            for gone in set(asked) - {alert.id for alert in found}:
                self.registry.forget(gone)
            self.registry.silence(silences, now_ns)
        for robot in {alert.robot for alert in found}:
            self._call(self.watchers, robot)

    async def purge(self) -> int:
        """Delete some of what is over for too long, or too much; how many alerts went. Raises StoreError."""
        before_ns = self._clock.wall_ns() - round(self._limits.alerts_kept_s * 1e9)
        most = self._limits.alerts_kept
        return await self._database.run(lambda engine: table.purge_alerts(engine, before_ns=before_ns, most=most))

    def tick(self) -> None:
        """What time does to alerts; `run` calls it once a second."""
        self.registry.tick(self._clock.wall_ns())
        self._wake.set()

    async def _save_some(self, *, all_of_it: bool) -> bool:
        async with self._lock:
            changes = self.registry.changes(self._clock.wall_ns(), most=BATCH, all_of_it=all_of_it)
            if changes:
                await self._store(changes)
        return bool(changes)

    async def _store(self, changes: Sequence[Change]) -> None:
        def job(engine: StoreEngine) -> list[tuple[bool, Alert | None]]:
            return [_save(engine, change.alert) for change in changes]

        try:
            outcomes = await self._database.run(job)
        except UnstorableError as error:
            await self._store_apart(changes, error)
            return
        except BaseException:
            for change in changes:
                self.registry.failed(change)
            raise
        for change, (saved, stored) in zip(changes, outcomes, strict=True):
            if saved:
                self.registry.stored(change)
                after = replace(change.alert, revision=change.alert.revision + 1)
                for what in [what for what in change.news if what != "seen"] or change.news:
                    self.publish(what, after)
            else:
                self.registry.clashed(change, stored, self._clock.wall_ns())

    async def _store_apart(self, changes: Sequence[Change], error: UnstorableError) -> None:
        """No database takes one of these ever: it is let go, so that it does not hold up the others."""
        if len(changes) > 1:
            for change in changes:
                await self._store([change])
            return
        alert = changes[0].alert
        log.error("alert %s of robot %s can never be stored: %s", alert.id, alert.robot, error)
        self.registry.forget(alert.id)

    def publish(self, what: str, alert: Alert, *, by: str = "", remark: bool = False) -> None:
        """Tell of an alert that is stored, or only of a remark; "seen" is no news for people, and no event."""
        if self._emit is not None and what != "seen":
            self._emit(*event_of(what, alert, by=by, remark=remark))
        self._call(self.listeners, "changed" if what == "seen" else what, alert)
        self._call(self.watchers, alert.robot)

    def _call(self, listeners: Sequence[Callable[..., None]], *told: Any) -> None:
        for listener in listeners:
            try:
                listener(*told)
            except Exception:
                log.exception("who listens to alerts failed at %s", told[0])

    def _is_ours(self, alert: Alert) -> bool:
        return not self._database.shared or alert.gateway == self._database.gateway_id

    async def _tick_all(self) -> None:
        while True:
            await asyncio.sleep(self._config.tick_s)
            for _ in self.registry.ticking(self._clock.wall_ns()):
                await asyncio.sleep(0)  # others have their turn
            self._wake.set()

    async def _save_all(self) -> None:
        while True:
            await self._wake.wait()
            await asyncio.sleep(GATHER_S)
            self._wake.clear()
            await self._try(self.save)  # what fails is a change still, with the next tick

    async def _look_all(self) -> None:
        while True:
            await asyncio.sleep(LOOK_S)
            await self._try(self.refresh)

    async def _purge_all(self) -> None:
        while True:
            await self._try(self._purge)
            await asyncio.sleep(PURGE_EVERY_S)

    async def _purge(self) -> None:
        while await self.purge():
            pass

    async def _try(self, action: Callable[[], Awaitable[None]]) -> None:
        """Something with the store; where it cannot now, that is said once, and it is done again later."""
        try:
            await action()
            self._trouble = ""
        except StoreError as error:
            if str(error) != self._trouble:
                log.warning("alerts wait for the store: %s", error)
            self._trouble = str(error)

    async def read(self, job: Callable[[StoreEngine], Result]) -> Result:
        """Look into the store, at a single moment of it."""

        def within_one(engine: StoreEngine) -> Result:
            with engine.transaction(write=False):
                return job(engine)

        return await self._database.read(within_one)


def _save(engine: StoreEngine, alert: Alert) -> tuple[bool, Alert | None]:
    """Whether it was stored, and what is there where it was not."""
    if table.save_alert(engine, alert):
        return True, None
    stored = table.read_alert(engine, alert.id)
    if stored is None or stored.revision == alert.revision:
        stored = table.find_unresolved(engine, alert.robot, alert.cause) or stored
    return False, stored
