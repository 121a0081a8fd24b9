"""Notices as the gateway runs them: every route by itself, compared with what it was told before.

What was told is in the store, so that a restart tells nothing twice (but for what was under way) and forgets nothing;
of several gateways on one store one at a time sends. All methods on the event loop.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Sequence
from dataclasses import astuple
from typing import Any, TypeVar

import h11

from gateway.alerts.desk import AlertDesk
from gateway.alerts.errors import UnknownRouteError
from gateway.alerts.keeper import Database
from gateway.alerts.notices.document import Notice, cloud_event, event_bytes, mail_bytes, test_event
from gateway.alerts.notices.line import Line
from gateway.alerts.notices.mail import MailError, send
from gateway.alerts.notices.plan import Told
from gateway.alerts.notices.route import PRIVATE_HINT, Delivery, Route, RouteState
from gateway.domain.alert import Alert
from gateway.errors import StoreError
from gateway.outbound.webhook import Webhook, post
from gateway.store.alert_notices import keep_told, told_rows
from gateway.store.alerts import read_alerts
from gateway.store.engine import StoreEngine
from gateway.store.updates import take_duty
from metaros.clock import Clock
from metaros.limits import LIMITS, Limits

__all__ = ["Delivery", "Notices", "RouteState"]

log = logging.getLogger(__name__)
Result = TypeVar("Result")

LOOK_S = 0.5
DUTY = "notices"
DUTY_S = 15.0
DUTY_EVERY_S = 5.0


class Notices:
    """Who is told of alerts, and how that goes."""

    def __init__(
        self,
        desk: AlertDesk,
        database: Database,
        *,
        routes: Sequence[Route] = (),
        clock: Clock,
        limits: Limits = LIMITS,
    ) -> None:
        self._desk = desk
        self._database = database
        self._clock = clock
        self._limits = limits
        self._lines = {route.name: Line(route, limits=limits) for route in routes}
        self._on_duty = False

    async def start(self) -> None:
        """Know what was told before, if it is this gateway's turn. Raises StoreError."""
        if self._lines:
            await self.take_turn()

    async def run(self) -> None:
        """Until cancelled; without routes there is nothing to do."""
        async with asyncio.TaskGroup() as tasks:
            for line in self._lines.values():
                tasks.create_task(self._tell_all(line))
            if self._lines:
                tasks.create_task(self._take_turns())

    async def close(self) -> None:
        """Keep what was told last, if the store takes it, and let another gateway go on."""
        for line in self._lines.values():
            try:
                await self._keep(line)
            except StoreError as error:
                log.warning("what route %s was told last is not kept: %s", line.route.name, error)

    def routes(self) -> list[RouteState]:
        """Where notices go, and what became of them since the gateway began."""
        return [line.state for line in self._lines.values()]

    async def test(self, name: str, *, by: str) -> Delivery:
        """Send a notice that says that it is a test; UnknownRouteError."""
        line = self._lines.get(name)
        if line is None:
            raise UnknownRouteError(f"there is no route {name[:64]!r}; the file of --notify names them")
        now_ns, to = self._clock.wall_ns(), line.route.to
        if isinstance(to, Webhook):
            document = test_event(line.route, by=by, now_ns=now_ns, gateway=self._database.gateway_id)
            return await self._post(to, document, now_ns)
        words = f"This is a test by {by}: nothing is wrong. Alerts of route {name} come to you."
        mail = mail_bytes(to, (), now_ns=now_ns, test=words)
        return await self._deliver(lambda: send(to, mail))

    async def take_turn(self) -> bool:
        """Whether it is this gateway's turn to send; when it becomes so, know what was told. Raises StoreError."""
        now_ns = self._clock.wall_ns()
        before, self._on_duty = self._on_duty, False
        holder, for_ns = self._database.gateway_id, round(DUTY_S * 1e9)
        mine = not self._database.shared or await self._database.run(
            lambda engine: take_duty(engine, DUTY, holder, now_ns=now_ns, for_ns=for_ns)
        )
        if mine and not before:
            await self._know(now_ns)
        self._on_duty = mine
        return mine

    async def tell(self, name: str) -> None:
        """Tell one route what is due. Raises StoreError where what it was told cannot be kept: it is, the next time."""
        line = self._lines[name]
        await self._keep(line)
        if not self._on_duty:
            return
        due = line.due(list(self._desk.known()), self._clock.wall_ns(), self._clock.monotonic_s())
        most = 1 if isinstance(line.route.to, Webhook) else self._limits.notice_alerts
        for first in range(0, len(due), most):
            some = due[first : first + most]
            done = await self._send(line.route, some)
            now_ns = self._clock.wall_ns()
            if not done.ok:
                if done.error != line.state.last_error:
                    log.warning("notices do not reach route %s: %s", name, done.error)
                if given_up := line.failed(some, done, now_ns, self._clock.monotonic_s()):
                    log.error("%d notices of route %s are given up: %s", given_up, name, done.error)
                break
            line.sent(some, now_ns)
            await self._keep(line)
        await self._keep(line)

    async def _send(self, route: Route, notices: Sequence[Notice]) -> Delivery:
        now_ns, to = self._clock.wall_ns(), route.to
        if isinstance(to, Webhook):
            return await self._post(to, cloud_event(notices[0], now_ns=now_ns, link=route.link), now_ns)
        mail = mail_bytes(to, notices, now_ns=now_ns, link=route.link)
        return await self._deliver(lambda: send(to, mail))

    async def _post(self, webhook: Webhook, document: dict[str, Any], now_ns: int) -> Delivery:
        body, notice = event_bytes(document), str(document["id"])
        return await self._deliver(lambda: post(webhook, body, message=notice, at_s=now_ns // 10**9, hint=PRIVATE_HINT))

    async def _deliver(self, attempt: Callable[[], Any]) -> Delivery:
        """One attempt within its time; whatever goes wrong is in what comes back."""
        began_s, status, error = self._clock.monotonic_s(), 0, ""
        try:
            async with asyncio.timeout(self._limits.notice_s):
                status = await attempt()
            error = "" if 200 <= status < 300 else f"the receiver answers {status}"
        except TimeoutError:
            error = f"no answer in {self._limits.notice_s:g} s"
        except MailError as refused:
            status, error = refused.status, str(refused)
        except (OSError, ValueError, h11.ProtocolError) as failure:  # ValueError: a name that is none for TLS
            error = str(failure) or type(failure).__name__
        return Delivery(ok=not error, status=status, error=error, took_s=self._clock.monotonic_s() - began_s)

    async def _keep(self, line: Line) -> None:
        """Let the store know what the route was told."""
        if not line.unkept:
            return
        rows = [astuple(told) for told in line.unkept.values()]
        kept = dict(line.unkept)
        await self._database.run(lambda engine: keep_told(engine, rows))
        for key, told in kept.items():
            if line.unkept.get(key) == told:
                del line.unkept[key]

    async def _know(self, now_ns: int) -> None:
        """What routes were told, and the alerts that ended without their hearing of it."""
        since_ns = now_ns - round(self._limits.notice_tries_s * 1e9)

        def job(engine: StoreEngine) -> tuple[list[Told], list[Alert]]:
            with engine.transaction(write=False):
                rows = told_rows(engine, resolved_after_ns=since_ns)
                told = [Told(alert=r[0], route=r[1], stage=r[2], severity=r[3], times=r[4], told_ns=r[5]) for r in rows]
                open_ones = [item.alert for item in told if item.stage != "resolved"]
                return told, [alert for alert in read_alerts(engine, open_ones) if not alert.unresolved]

        told, over = await self._database.read(job)
        for line in self._lines.values():
            line.know((item for item in told if item.route == line.route.name), over, now_ns)

    async def _tell_all(self, line: Line) -> None:
        while True:
            await asyncio.sleep(LOOK_S)
            try:
                await self.tell(line.route.name)
            except StoreError as error:
                log.debug("what route %s was told waits for the store: %s", line.route.name, error)
            except Exception:  # whatever is wrong with a notice, the gateway goes on
                log.exception("notices of route %s failed: a mistake of ours", line.route.name)

    async def _take_turns(self) -> None:
        while True:
            await asyncio.sleep(DUTY_EVERY_S)
            try:
                await self.take_turn()
            except StoreError as error:
                log.debug("notices wait for the store: %s", error)
