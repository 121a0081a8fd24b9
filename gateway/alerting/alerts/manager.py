"""The alert manager: takes findings, keeps alerts in the store, and acknowledges, resolves and silences them.

registry.py alone decides what follows from what; store_sync.py stores it. All methods on the event loop.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from gateway.alerting.alerts.config import AlertConfig
from gateway.alerting.alerts.errors import AlertStateError, UnknownAlertError, UnknownSilenceError
from gateway.alerting.alerts.silencing import checked_silence, checked_text, within
from gateway.alerting.alerts.store_sync import Database, StoreSync
from gateway.alerting.alerts.summary import alert_counts, robot_counts
from gateway.domain.alert import Alert, AlertFilter, Remark, Silence, is_alert_id
from gateway.domain.finding import Edge, FindingSeverity
from gateway.domain.idempotency import IdempotentRequest
from gateway.errors import StoreError
from gateway.store.alerting import alerts as table
from gateway.store.alerting import remarks as talk
from gateway.store.engine import StoreEngine
from gateway.store.fleet.idempotency import made_before, remember_made
from metaros.clock import Clock
from metaros.limits import LIMITS, Limits

__all__ = ["AlertManager"]

log = logging.getLogger(__name__)
TRIES = 8


class AlertManager:
    """`start` it, let `run` run, and `report` findings."""

    def __init__(
        self,
        database: Database,
        *,
        clock: Clock,
        emit: Callable[[str, str, Mapping[str, Any]], None] | None = None,
        limits: Limits = LIMITS,
        config: AlertConfig | None = None,
        topics_of: Callable[[str, str], Collection[str]] = lambda robot, node: (),
    ) -> None:
        """`emit` is the journal's: kind, robot, data. `topics_of` says which topics a robot's node publishes."""
        self._clock = clock
        self._limits = limits
        self._store_sync = StoreSync(
            database,
            clock=clock,
            emit=emit,
            limits=limits,
            config=config or AlertConfig(),
            topics_of=topics_of,
        )
        self._registry = self._store_sync.registry

    @property
    def refused(self) -> int:
        """Findings that there was no room for, not even to wait."""
        return self._registry.refused

    async def start(self, *, adopt: bool = True) -> None:
        """Know the alerts of the store, and wait for this gateway's findings to be told again. Raises StoreError.

        Without `adopt` it is said robot by robot whose findings are this gateway's.
        """
        await self._store_sync.start(adopt=adopt)

    async def run(self) -> None:
        """Until cancelled."""
        await self._store_sync.run()

    async def close(self) -> None:
        """Store what waits, if the store takes it."""
        await self._store_sync.close()

    def report(self, edges: Sequence[Edge]) -> None:
        """What the evaluator found since last time. In pieces of a few hundred at most: it is worked off at once."""
        if edges:
            self._registry.apply(edges, self._clock.wall_ns())
            self._store_sync.changed()

    def adopt(self, robot: str) -> None:
        """This gateway judges the robot from now on: what of its alerts is not told again within the grace is over."""
        self._registry.adopt(robot, self._clock.wall_ns())

    def release(self, robot: str) -> None:
        """Another gateway judges the robot from now on: what is told of it here does not count."""
        self._registry.release(robot)

    def listen(self, listener: Callable[[str, Alert], None]) -> None:
        """Call back for what this gateway stored: opened (also again), escalated, acknowledged, resolved, changed."""
        self._store_sync.listeners.append(listener)

    def on_change(self, listener: Callable[[str], None]) -> None:
        """Call back for every robot whose alerts in the store changed, by whichever gateway; "" is the fleet."""
        self._store_sync.watchers.append(listener)

    def of(self, robot: str) -> tuple[Alert, ...]:
        """The robot's alerts that are not resolved, the worst first."""
        return self._registry.of(robot)

    def known(self) -> Iterable[Alert]:
        """Every alert that can still change by itself, and those that were resolved a moment ago."""
        return self._registry.all()

    def robot_counts(self, robot: str) -> dict[str, int]:
        """How many of the robot's alerts people should look at: open in all, and of them error and warning."""
        return robot_counts(self._registry.of(robot))

    def counts(self, sees: Callable[[str], bool] | None = None) -> dict[str, Any]:
        """How many alerts are open, acknowledged, quiet, and how bad they are, of what somebody may see."""
        return alert_counts(self._registry.all(), sees)

    async def get(self, alert_id: str) -> Alert:
        """One alert; UnknownAlertError."""
        found = (
            await self._store_sync.read(lambda engine: table.read_alert(engine, alert_id))
            if is_alert_id(alert_id)
            else None
        )
        if found is None:
            raise UnknownAlertError.of(alert_id)
        return found

    async def remarks(self, alert_id: str) -> list[Remark]:
        """What was said and done about an alert, the oldest first."""
        return await self._store_sync.read(lambda engine: talk.list_remarks(engine, alert_id))

    async def acknowledge(self, alert_id: str, *, by: str, text: str = "") -> Alert:
        """Somebody knows; AlertStateError where it is resolved. Once it is, it stays who was first."""

        def change(alert: Alert, now_ns: int) -> Alert:
            if alert.state == "acknowledged":
                return alert
            return replace(alert, state="acknowledged", acknowledged_ns=now_ns, acknowledged_by=by)

        return await self._do(alert_id, change, kind="acknowledged", by=by, text=text)

    async def unacknowledge(self, alert_id: str, *, by: str, text: str = "") -> Alert:
        """Nobody sees to it any more; AlertStateError where it is resolved."""

        def change(alert: Alert, now_ns: int) -> Alert:
            return replace(alert, state="open", acknowledged_ns=0, acknowledged_by="")

        return await self._do(alert_id, change, kind="unacknowledged", by=by, text=text)

    async def resolve(self, alert_id: str, *, by: str, text: str = "") -> Alert:
        """Over, as somebody says: what goes on of it is no news. AlertStateError where it is resolved."""

        def change(alert: Alert, now_ns: int) -> Alert:
            return replace(alert, state="resolved", resolved_ns=now_ns, resolved_by=by)

        return await self._do(alert_id, change, kind="resolved", by=by, text=text)

    async def assign(self, alert_id: str, *, assignee: str, by: str) -> Alert:
        """Somebody is to see to it, "" is nobody; AlertStateError where it is resolved."""
        checked_text("assignee", assignee, self._limits)
        return await self._do(
            alert_id, lambda alert, now_ns: replace(alert, assignee=assignee), kind="assigned", by=by, text=assignee
        )

    async def comment(self, alert_id: str, *, text: str, by: str, once: IdempotentRequest | None = None) -> Alert:
        """Words about it, also when it is over; said once under a key. IdempotencyConflictError."""
        return await self._do(alert_id, None, kind="comment", by=by, text=text, once=once)

    async def normal(self, alert_id: str, *, by: str, text: str = "") -> Alert:
        """Note that somebody called it normal, and what was learned of it; also when it is over."""
        return await self._do(alert_id, None, kind="normal", by=by, text=text)

    async def attach_clip(self, alert_id: str, recording_id: str, *, by: str = "") -> Alert:
        """The recording that shows it, also when it is over."""
        return await self._do(
            alert_id, lambda alert, now_ns: replace(alert, clip=recording_id), kind="clip", by=by, text=recording_id
        )

    async def silences(self, *, sees: Callable[[str], bool] | None = None) -> list[Silence]:
        """Those that are not over, the one that ends first is first; with `sees`, those that a scope may know of."""
        now_ns = self._clock.wall_ns()
        found = await self._store_sync.read(lambda engine: talk.current_silences(engine, now_ns=now_ns))
        return [item for item in found if sees is None or within(item, sees)]

    async def get_silence(self, silence_id: str) -> Silence:
        """One silence, also when it is over; UnknownSilenceError."""
        found = None
        if is_alert_id(silence_id):
            found = await self._store_sync.read(lambda engine: talk.read_silence(engine, silence_id))
        if found is None:
            raise UnknownSilenceError.of(silence_id)
        return found

    async def add_silence(
        self,
        *,
        robots: Sequence[str] = (),
        causes: Sequence[str] = (),
        up_to: FindingSeverity = "error",
        from_ns: int = 0,
        until_ns: int,
        reason: str = "",
        by: str,
        once: IdempotentRequest | None = None,
    ) -> Silence:
        """Tell nobody of such alerts for a while; under a key the one that the same request made.

        Raises:
            IdempotencyConflictError: the key was used for another request.
            InvalidRequestError: a pattern, the time or the reason is none, or too much.
            TooManyError: there are as many silences as can be.
        """
        now_ns = self._clock.wall_ns()
        made = checked_silence(
            robots=robots,
            causes=causes,
            up_to=up_to,
            from_ns=from_ns,
            until_ns=until_ns,
            reason=reason,
            by=by,
            now_ns=now_ns,
            limits=self._limits,
        )
        kept_ns, most = round(self._limits.alerts_kept_s * 1e9), self._limits.silences

        def job(engine: StoreEngine) -> list[Silence]:
            if not made_before(engine, once):
                talk.add_silence(engine, made, most=most, now_ns=now_ns, kept_ns=kept_ns)
                remember_made(engine, once, made.id, now_ns=now_ns)
            return talk.current_silences(engine, now_ns=now_ns)

        await self._write_silences(job, now_ns)
        return await self.get_silence(await self._store_sync.read(lambda engine: made_before(engine, once)) or made.id)

    async def end_silence(self, silence_id: str, *, by: str) -> Silence:
        """Let a silence be over now; UnknownSilenceError."""
        now_ns = self._clock.wall_ns()

        def job(engine: StoreEngine) -> list[Silence]:
            talk.end_silence(engine, silence_id, now_ns=now_ns)
            return talk.current_silences(engine, now_ns=now_ns)

        await self.get_silence(silence_id)
        await self._write_silences(job, now_ns)
        log.info("silence %s was ended by %s", silence_id, by)
        return await self.get_silence(silence_id)

    async def save(self) -> None:
        """Store what changed, and tell it; `run` does that. Raises StoreError, and then it is a change still."""
        await self._store_sync.save()

    async def refresh(self) -> None:
        """Learn what other gateways changed; `run` does that. Raises StoreError."""
        await self._store_sync.refresh()

    async def purge(self) -> int:
        """Delete some of what is over for too long, or too much; how many alerts went; `run` does that."""
        return await self._store_sync.purge()

    def tick(self) -> None:
        """What time does to alerts; `run` does that."""
        self._store_sync.tick()

    async def _write_silences(self, job: Callable[[StoreEngine], Sequence[Silence]], now_ns: int) -> None:
        await self._store_sync.write(job, lambda silences: self._registry.silence(silences, now_ns))

    async def _do(
        self,
        alert_id: str,
        change: Callable[[Alert, int], Alert] | None,
        *,
        kind: str,
        by: str,
        text: str,
        once: IdempotentRequest | None = None,
    ) -> Alert:
        """What somebody does to an alert, with its remark, in one transaction; None: only the remark."""
        text = checked_text("text", text, self._limits)
        over = kind in ("comment", "normal", "clip")
        now_ns = self._clock.wall_ns()
        remark = Remark(alert=alert_id, number=0, at_ns=now_ns, by=by, kind=kind, text=text)

        def job(engine: StoreEngine) -> tuple[Alert, bool]:
            for _ in range(TRIES):
                alert = table.read_alert(engine, alert_id)
                if alert is None:
                    raise UnknownAlertError.of(alert_id)
                if made_before(engine, once):
                    return alert, False
                if not alert.unresolved and not over:
                    raise AlertStateError(f"alert {alert_id} is resolved")
                after = replace(change(alert, now_ns), changed_ns=now_ns) if change else alert
                if change and replace(after, changed_ns=alert.changed_ns) == alert:
                    return alert, False
                if not change or table.save_alert(engine, after):
                    talk.add_remark(engine, remark, most=self._limits.alert_remarks)
                    remember_made(engine, once, alert_id, now_ns=now_ns)
                    return replace(after, revision=after.revision + bool(change)), True
            raise StoreError(f"alert {alert_id} changes all the time: try again")

        alert, done = await self._store_sync.write(job, lambda done: self._registry.learn(done[0], now_ns))
        if done:
            what = kind if kind in ("acknowledged", "resolved") else "changed"
            self._store_sync.publish(what, alert, by=by, remark=change is None)
        return alert

    async def list(self, wanted: AlertFilter, *, limit: int, before: str | None = None) -> list[Alert]:
        """The newest alerts that somebody wants, the newest first; `before` is the id after which to go on."""
        return await self._store_sync.read(lambda engine: table.list_alerts(engine, wanted, limit=limit, before=before))
