"""Stores the results of deliveries: many in one transaction, retried while the store cannot."""

from __future__ import annotations

import asyncio
import logging
import random  # noqa: TID251 - the type only; the generator is an argument
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace

from gateway.automation.queue.backoff import attempt_result, end_of
from gateway.automation.queue.database import Database
from gateway.automation.queue.group_commit import GroupCommit
from gateway.domain.automation.delivery import WAITING, Delivery, Handler, Put, Result
from gateway.errors import StoreError, UnstorableError
from gateway.store.automation.deliveries import AttemptResult, Ready, settle
from metaros.clock import Clock
from metaros.limits import Limits

__all__ = ["ResultWriter"]

log = logging.getLogger(__name__)

TOGETHER = 512
AGAIN_S = 0.5


class ResultWriter:
    """`notify` is told of what waits again or newly; `counts` are the ends by state since the start."""

    def __init__(
        self,
        database: Database,
        *,
        holder: str,
        clock: Clock,
        rng: random.Random,
        limits: Limits,
        notify: Callable[[Sequence[Ready]], None],
    ) -> None:
        self.counts: Counter[str] = Counter()
        self._database = database
        self._holder = holder
        self._clock = clock
        self._rng = rng
        self._limits = limits
        self._notify = notify
        self._group = GroupCommit[AttemptResult, bool](
            self._commit,
            size_bytes=lambda outcome: sum(len(one.payload) for one in outcome.puts),
            most_items=TOGETHER,
            most_bytes=limits.delivery_batch_bytes,
        )

    async def settle(self, handler: Handler | None, delivery: Delivery, result: Result) -> None:
        """Store a try's result, however long the store takes to be there again."""
        outcome = attempt_result(delivery, result, rng=self._rng, now_ns=self._clock.wall_ns())
        outcome = replace(outcome, puts=(*outcome.puts, *_follows(handler, delivery, result)))
        while True:
            try:
                ours = await self._group.submit(outcome)
            except UnstorableError as error:
                if not outcome.puts:
                    log.error("how delivery %s ended can never be stored: %s", delivery.id, error)
                    return
                log.error("what follows from delivery %s can never be stored: %s", delivery.id, error)
                outcome = replace(outcome, puts=())
            except StoreError as error:
                log.debug("delivery %s waits for the store: %s", delivery.id, error)
                await asyncio.sleep(AGAIN_S)
            else:
                break
        if ours:
            self._report(outcome)

    def _report(self, outcome: AttemptResult) -> None:
        self.counts[outcome.state] += 1
        again = [outcome.delivery.put] if outcome.state == WAITING else []
        rows = [Ready(one.kind, one.target, outcome.due_ns) for one in again]
        self._notify([*rows, *(Ready(one.kind, one.target, one.due_ns) for one in outcome.puts)])

    async def _commit(self, outcomes: Sequence[AttemptResult]) -> Sequence[bool | Exception]:
        now_ns = self._clock.wall_ns()
        names = {"holder": self._holder, "gateway": self._database.gateway_id}
        try:
            return await self._database.run(
                lambda engine: settle(engine, outcomes, **names, now_ns=now_ns, limits=self._limits)
            )
        except UnstorableError as error:
            if len(outcomes) == 1:
                return [error]
            return [answer for one in outcomes for answer in await self._commit([one])]


def _follows(handler: Handler | None, delivery: Delivery, result: Result) -> Sequence[Put]:
    """What its handler wants to be put as it ends."""
    end = end_of(delivery, result)
    if end is None or handler is None:
        return ()
    try:
        return handler.ended(delivery, end)
    except Exception:
        log.exception("what follows from delivery %s is not known", delivery.id)
        return ()
