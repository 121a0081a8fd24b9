"""The audit log of a running gateway: a row is in the database before its cause is answered.

What has come meanwhile is appended in one transaction, so many requests share one commit. While the database
cannot be written, rows wait in memory up to a bound; then nothing that changes something is let in any more.
Refusals are bounded by the hour: somebody who tries all day must not fill the disk. Those left out are counted.
"""

from __future__ import annotations

import asyncio
import logging
from collections import deque
from functools import partial
from typing import Any

from gateway.errors import GatewayError, StoreError, TooManyError
from gateway.store import Store
from gateway.store.accounts.audit import (
    AuditEvent,
    AuditFault,
    AuditHead,
    AuditRow,
    append,
    read_head,
    read_page,
    verify_rows,
)
from gateway.store.accounts.audit_heads import Seal, check_heads, export_head
from gateway.store.accounts.audit_proof import MAX_FAULTS, STEP_ROWS, proof
from gateway.store.objects import ObjectStore
from metaros.clock import Clock
from metaros.errors import MetarosError
from metaros.limits import LIMITS, Limits

__all__ = ["AuditLog"]

log = logging.getLogger(__name__)
BATCH = 256
RETRY_S = 0.5
EXPORT_S = 3600.0
EXPORT_RETRY_S = 60.0
HOUR_S = 3600.0
CLOSE_S = 2.0


class AuditLog:
    """Write by `record`, read by `page`, prove by `verify`."""

    def __init__(
        self, store: Store, objects: ObjectStore, *, clock: Clock, seal: Seal | None = None, limits: Limits = LIMITS
    ) -> None:
        self._store = store
        self._objects = objects
        self._clock = clock
        self._seal = seal
        self._limits = limits
        self._waiting: deque[tuple[AuditEvent, asyncio.Future[None] | None]] = deque()
        self._writer: asyncio.Task[None] | None = None
        self._closing = False
        self._refusals = 0
        self._left_out = 0
        self._hour_s = clock.monotonic_s()
        self._proving = False

    async def record(self, *, wait_s: float = 5.0, **facts: Any) -> None:
        """Write a row; returns when it is committed, or after `wait_s`: then it waits for the database.

        Raises:
            StoreError: too many rows wait already; this one is not written.
        """
        self.check_room()
        done: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._put(self._event(facts), done)
        await asyncio.wait({done}, timeout=wait_s)

    def add(self, **facts: Any) -> None:
        """Write a row without waiting for it: of what is over already, whether there is room or not."""
        self._put(self._event(facts), None)

    @property
    def waiting(self) -> int:
        """Rows that wait for the database."""
        return len(self._waiting)

    def check_room(self) -> None:
        """StoreError while so much waits for the database that nothing may change any more."""
        if len(self._waiting) >= self._limits.audit_queue:
            raise StoreError(f"{len(self._waiting)} rows of the audit log wait for the database: nothing is changed")

    def refuse(self, **facts: Any) -> None:
        """Write a row about somebody who was refused; nobody waits for it, and of too many only the number is kept."""
        now_s = self._clock.monotonic_s()
        if now_s - self._hour_s >= HOUR_S:
            self._hour_s, self._refusals = now_s, 0
            self._count_left_out()
        self._refusals += 1
        if self._refusals > self._limits.audit_refusals_per_hour or len(self._waiting) >= self._limits.audit_queue:
            self._left_out += 1
        else:
            self._put(self._event(facts), None)

    async def run(self) -> None:
        """Export the head every hour, until cancelled."""
        while True:
            wait_s = EXPORT_S
            try:
                await self.export()
            except GatewayError as error:
                log.warning("the audit log's head is not exported: %s", error)
                wait_s = EXPORT_RETRY_S
            await asyncio.sleep(wait_s)

    async def close(self) -> None:
        """Append what waits, as far as the database takes it now, and export the head."""
        self._closing = True
        self._count_left_out()
        await self._settled()
        if self._waiting:
            log.error("%d rows of the audit log were not written: the database did not take them", len(self._waiting))
        try:
            async with asyncio.timeout(CLOSE_S):
                await self.export()
        except (GatewayError, TimeoutError) as error:
            log.warning("the audit log's last head is not exported: %s", error)

    async def page(self, *, before: int | None = None, limit: int, action: str = "", name: str = "") -> list[AuditRow]:
        """Rows, the newest first; what this gateway was told before is among them, if the database takes it."""
        await self._settled()
        return await self._store.read(
            lambda engine: read_page(engine, before=before, limit=limit, action=action, name=name)
        )

    async def head(self) -> AuditHead:
        """The newest row's number and hash."""
        await self._settled()
        return await self._store.read(read_head)

    async def verify(self) -> dict[str, Any]:
        """Prove every row and compare the exported heads: {ok, rows, hash, faults, heads, heads_sealed, heads_error}.

        Raises:
            TooManyError: another proof is under way.
        """
        if self._proving:
            raise TooManyError("a proof of the audit log is under way: come back when it is done")
        self._proving = True
        try:
            await self._settled()
            return await self._verified()
        finally:
            self._proving = False

    async def export(self) -> AuditHead | None:
        """Put the head into the object store, unless it is there."""
        loop, gateway = asyncio.get_running_loop(), self._store.gateway_id

        def run(job: Any, /) -> Any:  # on the thread: the ledger's jobs go through the writer
            return asyncio.run_coroutine_threadsafe(self._store.run(job), loop).result()

        now_ns = self._clock.wall_ns()
        return await self._store.read_slowly(
            lambda engine: export_head(engine, run, self._objects, gateway=gateway, now_ns=now_ns, seal=self._seal)
        )

    async def _verified(self) -> dict[str, Any]:
        """Step by step, so that other readers come in between."""
        at, more = AuditHead(0, ""), True
        faults: list[AuditFault] = []
        while more:
            at, found, more = await self._store.read(partial(verify_rows, known=at, limit=STEP_ROWS))
            faults += found[: MAX_FAULTS - len(faults)]
        try:
            heads = await self._store.read_slowly(
                lambda engine: check_heads(engine, self._objects, limit=self._limits.audit_heads, seal=self._seal)
            )
        except GatewayError as error:
            return proof(at, faults, None, error=str(error))
        return proof(at, faults, heads)

    async def _settled(self) -> None:
        if self._writer is not None:
            await asyncio.wait({self._writer}, timeout=CLOSE_S)

    def _put(self, event: AuditEvent, done: asyncio.Future[None] | None) -> None:
        self._waiting.append((event, done))
        if self._writer is None or self._writer.done():
            self._writer = asyncio.create_task(self._write())

    def _count_left_out(self) -> None:
        left_out, self._left_out = self._left_out, 0
        if left_out:
            detail = f"{left_out} refusals of the hour before have no row of their own"
            self._put(self._event({"kind": "gateway", "action": "refusals", "detail": detail}), None)

    def _event(self, facts: dict[str, Any]) -> AuditEvent:
        return AuditEvent(at_ns=self._clock.wall_ns(), gateway=self._store.gateway_id, **facts)

    async def _write(self) -> None:
        """Append all that waits. On an error it still waits, so nothing is lost while the process lives."""
        failed = False
        while self._waiting:
            some = [self._waiting[index] for index in range(min(BATCH, len(self._waiting)))]
            events = [event for event, _ in some]
            try:
                await self._store.run(partial(append, events=events))
            except MetarosError as error:
                if not failed:
                    log.warning("the audit log cannot be written; its rows wait: %s", error)
                if self._closing:
                    return
                failed = True
                await asyncio.sleep(RETRY_S)
                continue
            failed = False
            for _, done in some:
                self._waiting.popleft()
                if done is not None and not done.done():
                    done.set_result(None)
