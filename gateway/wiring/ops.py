"""Wires operations: metrics, traced samples, the report, and whether the gateway is draining.

Part of the wiring: it reads the living parts of all features, and belongs to none.
"""

from __future__ import annotations

import asyncio
import platform
import shutil
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from typing import Any, Final

from gateway.domain.fleet.lease import LeaseTable
from gateway.domain.sample import Run
from gateway.errors import StoreError
from gateway.identity.audit import AuditLog
from gateway.ingest.registry import Registry
from gateway.live.hub import Hub
from gateway.ops.fleet_view import FleetView
from gateway.ops.meters import Families, Meters
from gateway.ops.otlp import OtlpQueue, open_exporter
from gateway.ops.report import process_report, settings_report, task_kinds
from gateway.ops.sample_trace import TracedSample
from gateway.ops.traces import Traces
from gateway.settings import Settings
from gateway.store import Store
from gateway.store.storage import StorageManager
from gateway.store.writes import Committed, StreamWrite
from metaros.clock import Clock
from metaros.limits import LIMITS

__all__ = ["Operations", "Parts"]

_LOOK_S: Final = 1.0
_STORE_EVERY_S: Final = 300.0  # an account of the store goes through every table
_AT_ONCE: Final = 64  # robots that are read before others have their turn on the event loop


@dataclass(frozen=True, slots=True, kw_only=True)
class Parts:
    """The parts of the gateway that are observed."""

    registry: Registry
    store: Store
    storage: StorageManager
    hub: Hub
    audit: AuditLog
    leases: LeaseTable
    checks: Callable[[], dict[str, str]]
    automation: Callable[[Families], Awaitable[None]]
    cluster: Callable[[Families], None]


class Operations:
    """Lives on the event loop, from the gateway's start to its end."""

    def __init__(self, settings: Settings, parts: Parts, *, clock: Clock) -> None:
        self._settings = settings
        self._parts = parts
        self._clock = clock
        self._exporting: OtlpQueue | None = None
        if settings.otlp:
            self._exporting = OtlpQueue(open_exporter(settings.otlp, gateway_id=parts.store.gateway_id))
        self.meters = Meters()
        self.traces = Traces(clock, on_ended=self._ended)
        parts.hub.on_written = self.traces.written
        self.draining = False
        self.connections: Callable[[], int] = lambda: 0
        self._lag_s = 0.0
        self._store_bytes: dict[str, int] = {}

    async def run(self) -> None:
        """Look once a second, until cancelled."""
        async with asyncio.TaskGroup() as group:
            group.create_task(self._look())
            group.create_task(self._look_at_store())
            if self._exporting is not None:
                group.create_task(self._exporting.run())

    async def close(self) -> None:
        """Send the last traces."""
        if self._exporting is not None:
            await self._exporting.close()

    def checks(self) -> dict[str, str]:
        """Why the gateway takes nobody new, where it does not."""
        return {"end": "draining"} if self.draining else {}

    def on_samples(self, run: Run) -> None:
        """Samples have just been given to the hub; one of them may be followed."""
        if run.trace is not None:
            self.traces.arrived(run)

    def on_committed(self, done: Committed) -> None:
        """The store has more."""
        runs = [write.run for write in done.writes if isinstance(write, StreamWrite) and write.run is not None]
        rows = sum(len(write.rows) for write in done.writes if isinstance(write, StreamWrite) and write.rows)
        if runs or rows:
            self.meters.commit(samples=sum(run.count for run in runs), rows=rows)
        self.traces.committed(run for run in runs if run.trace is not None)

    async def families(self) -> Families:
        """What the living parts say now; other work has its turns in between."""
        found, parts = Families(), self._parts
        found.put("metaros_build", 1, _version(), platform.python_version())
        ready = all(state == "ok" for state in parts.checks().values())
        found.put("metaros_ready", ready)
        found.put("metaros_draining", self.draining)
        found.put("metaros_loop_lag_seconds", self._lag_s)
        found.put("metaros_connections", self.connections())
        found.put("metaros_viewers", parts.hub.viewers)
        found.put("metaros_viewer_dropped_samples", parts.hub.dropped)
        found.put("metaros_queue_bytes", parts.hub.waiting_bytes, "viewers")
        found.put("metaros_queue_limit_bytes", parts.hub.viewers * LIMITS.viewer_queue_bytes, "viewers")
        found.put("metaros_leases", self._parts.leases.held(now_s=self._clock.monotonic_s()))
        await self._robots(found)
        self._store(found)
        await parts.automation(found)
        parts.cluster(found)
        self._traces(found)
        return found

    async def report(self) -> dict[str, Any]:
        """Everything for a bug report, and no secret."""
        parts, records = self._parts, self._parts.registry.all()
        families = await self.families()
        numbers = {
            f"{sample.name}{dict(sample.labels) or ''}": float(sample.value)
            for family in families.collect()
            for sample in family.samples
            if "robot" not in sample.labels
        }
        return {
            "gateway": parts.store.gateway_id,
            "store": parts.store.store_id,
            "checks": parts.checks(),
            "draining": self.draining,
            "process": await asyncio.to_thread(process_report),
            "settings": settings_report(self._settings),
            "numbers": numbers,
            "robots": {
                "known": len(records),
                "online": sum(record.here for record in records),
                "elsewhere": sum(bool(record.owner_gateway) for record in records),
            },
            "tasks": task_kinds(LIMITS.debug_tasks),
        }

    async def _robots(self, found: Families) -> None:
        records, view = self._parts.registry.all(), FleetView(most=LIMITS.metrics_robots)
        for position, record in enumerate(records):
            if position % _AT_ONCE == _AT_ONCE - 1:
                await asyncio.sleep(0)
            if record.owner_counts is not None:
                view.add_remote(record.counts, online=record.online)
                continue
            statistics = record.statistics
            lag_s = record.lag_ns / 1e9 - statistics.link.clock_offset_ns / 1e9 if record.lag_ns is not None else None
            view.add(record.robot.id, record.here, record.counts, lag_s, record.rtt_s, statistics.outbox_bytes)
            view.lost((item.name, item.lost) for item in statistics.link.classes)
        await asyncio.to_thread(view.put, found)  # it sorts them all

    def _store(self, found: Families) -> None:
        parts, settings = self._parts, self._settings
        found.put("metaros_store_ok", parts.store.error is None)
        found.put("metaros_objects_ok", parts.store.objects_error is None)
        found.put("metaros_queue_bytes", parts.store.queued_bytes, "store")
        found.put("metaros_queue_limit_bytes", settings.store_queue_bytes, "store")
        found.put("metaros_queue_items", parts.audit.waiting, "audit")
        found.put("metaros_queue_limit_items", LIMITS.audit_queue, "audit")
        for name, size_bytes in self._store_bytes.items():
            found.put("metaros_store_bytes", size_bytes, name)
        found.put("metaros_store_keep_bytes", settings.retention_bytes)
        found.put("metaros_disk_free_bytes", shutil.disk_usage(settings.data_dir).free)

    def _traces(self, found: Families) -> None:
        exporting = self._exporting
        found.put("metaros_traces_followed", self.traces.followed)
        found.put("metaros_traces_skipped", self.traces.skipped)
        found.put("metaros_traces_exported", exporting.exported if exporting is not None else 0)
        found.put("metaros_traces_lost", exporting.lost if exporting is not None else 0)

    def _ended(self, traced: TracedSample) -> None:
        self.meters.traced(traced)
        if self._exporting is not None:
            self._exporting.put(traced)

    async def _look(self) -> None:
        while True:
            due_s = self._clock.monotonic_s() + _LOOK_S
            await asyncio.sleep(_LOOK_S)
            self._lag_s = max(0.0, self._clock.monotonic_s() - due_s)
            self.traces.tick()

    async def _look_at_store(self) -> None:
        while True:
            try:
                document = await self._parts.storage.document()
            except StoreError:
                document = {"classes": ()}
            classes: Sequence[dict[str, Any]] = document["classes"]
            self._store_bytes = {str(item["class"]): int(item["bytes"]) for item in classes}
            await asyncio.sleep(_STORE_EVERY_S)


def _version() -> str:
    try:
        return version("metaros")
    except PackageNotFoundError:
        return "unpacked"
