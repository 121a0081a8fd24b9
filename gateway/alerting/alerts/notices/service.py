"""The service that sends notices: a queue and a task for each route, compared with what the route got before.

What was sent is in the store, so that a restart sends nothing twice (but for what was under way) and forgets nothing;
of several gateways on one store one at a time sends. All methods on the event loop.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Sequence
from dataclasses import astuple
from typing import Any, TypeVar

import h11

from gateway.alerting.alerts.errors import UnknownRouteError
from gateway.alerting.alerts.manager import AlertManager
from gateway.alerting.alerts.notices.document import Notice, cloud_event, event_bytes, mail_bytes, test_event
from gateway.alerting.alerts.notices.mail import MailError, send
from gateway.alerting.alerts.notices.plan import LastNotice
from gateway.alerting.alerts.notices.route import PRIVATE_HINT, Delivery, Route, RouteState
from gateway.alerting.alerts.notices.route_queue import RouteQueue
from gateway.alerting.alerts.store_sync import Database
from gateway.domain.alert import Alert
from gateway.errors import StoreError
from gateway.outbound.webhook import Webhook, post
from gateway.store.alerting.alerts import read_alerts
from gateway.store.alerting.notices import keep_told, told_rows
from gateway.store.engine import StoreEngine
from gateway.store.fleet.updates import take_duty
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
    """Sends notices of alerts to all routes."""

    def __init__(
        self,
        manager: AlertManager,
        database: Database,
        *,
        routes: Sequence[Route] = (),
        clock: Clock,
        limits: Limits = LIMITS,
    ) -> None:
        self._manager = manager
        self._database = database
        self._clock = clock
        self._limits = limits
        self._queues = {route.name: RouteQueue(route, limits=limits) for route in routes}
        self._leading = False

    async def start(self) -> None:
        """Read what was sent before, if this gateway is the one that sends. Raises StoreError."""
        if self._queues:
            await self.take_leadership()

    async def run(self) -> None:
        """Until cancelled; without routes there is nothing to do."""
        async with asyncio.TaskGroup() as tasks:
            for queue in self._queues.values():
                tasks.create_task(self._send_loop(queue))
            if self._queues:
                tasks.create_task(self._keep_leadership())

    async def close(self) -> None:
        """Keep what was told last, if the store takes it, and let another gateway go on."""
        for queue in self._queues.values():
            try:
                await self._keep(queue)
            except StoreError as error:
                log.warning("what route %s was told last is not kept: %s", queue.route.name, error)

    def routes(self) -> list[RouteState]:
        """Where notices go, and what became of them since the gateway began."""
        return [queue.state for queue in self._queues.values()]

    async def test(self, name: str, *, by: str) -> Delivery:
        """Send a notice that says that it is a test; UnknownRouteError."""
        queue = self._queues.get(name)
        if queue is None:
            raise UnknownRouteError(f"there is no route {name[:64]!r}; the file of --notify names them")
        now_ns, to = self._clock.wall_ns(), queue.route.to
        if isinstance(to, Webhook):
            document = test_event(queue.route, by=by, now_ns=now_ns, gateway=self._database.gateway_id)
            return await self._post(to, document, now_ns)
        words = f"This is a test by {by}: nothing is wrong. Alerts of route {name} come to you."
        mail = mail_bytes(to, (), now_ns=now_ns, test=words)
        return await self._deliver(lambda: send(to, mail))

    async def take_leadership(self) -> bool:
        """Whether this gateway is the one that sends; when it becomes so, read what was sent. Raises StoreError."""
        now_ns = self._clock.wall_ns()
        before, self._leading = self._leading, False
        holder, for_ns = self._database.gateway_id, round(DUTY_S * 1e9)
        mine = not self._database.shared or await self._database.run(
            lambda engine: take_duty(engine, DUTY, holder, now_ns=now_ns, for_ns=for_ns)
        )
        if mine and not before:
            await self._know(now_ns)
        self._leading = mine
        return mine

    async def send_due(self, name: str) -> None:
        """Send one route what is due. Raises StoreError where that cannot be stored: it is, the next time."""
        queue = self._queues[name]
        await self._keep(queue)
        if not self._leading:
            return
        due = queue.due(list(self._manager.known()), self._clock.wall_ns(), self._clock.monotonic_s())
        most = 1 if isinstance(queue.route.to, Webhook) else self._limits.notice_alerts
        for first in range(0, len(due), most):
            some = due[first : first + most]
            done = await self._send(queue.route, some)
            now_ns = self._clock.wall_ns()
            if not done.ok:
                if done.error != queue.state.last_error:
                    log.warning("notices do not reach route %s: %s", name, done.error)
                if given_up := queue.failed(some, done, now_ns, self._clock.monotonic_s()):
                    log.error("%d notices of route %s are given up: %s", given_up, name, done.error)
                break
            queue.sent(some, now_ns)
            await self._keep(queue)
        await self._keep(queue)

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

    async def _keep(self, queue: RouteQueue) -> None:
        """Let the store know what the route was told."""
        if not queue.unkept:
            return
        rows = [astuple(reported) for reported in queue.unkept.values()]
        kept = dict(queue.unkept)
        await self._database.run(lambda engine: keep_told(engine, rows))
        for key, reported in kept.items():
            if queue.unkept.get(key) == reported:
                del queue.unkept[key]

    async def _know(self, now_ns: int) -> None:
        """What routes were told, and the alerts that ended without their hearing of it."""
        since_ns = now_ns - round(self._limits.notice_tries_s * 1e9)

        def job(engine: StoreEngine) -> tuple[list[LastNotice], list[Alert]]:
            with engine.transaction(write=False):
                rows = told_rows(engine, resolved_after_ns=since_ns)
                reported = [
                    LastNotice(alert=r[0], route=r[1], stage=r[2], severity=r[3], times=r[4], told_ns=r[5])
                    for r in rows
                ]
                open_ones = [item.alert for item in reported if item.stage != "resolved"]
                return reported, [alert for alert in read_alerts(engine, open_ones) if not alert.unresolved]

        reported, over = await self._database.read(job)
        for queue in self._queues.values():
            queue.restore((item for item in reported if item.route == queue.route.name), over, now_ns)

    async def _send_loop(self, queue: RouteQueue) -> None:
        while True:
            await asyncio.sleep(LOOK_S)
            try:
                await self.send_due(queue.route.name)
            except StoreError as error:
                log.debug("what route %s was told waits for the store: %s", queue.route.name, error)
            except Exception:  # whatever is wrong with a notice, the gateway goes on
                log.exception("notices of route %s failed: a mistake of ours", queue.route.name)

    async def _keep_leadership(self) -> None:
        while True:
            await asyncio.sleep(DUTY_EVERY_S)
            try:
                await self.take_leadership()
            except StoreError as error:
                log.debug("notices wait for the store: %s", error)
