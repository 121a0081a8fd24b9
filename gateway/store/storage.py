"""Storage statistics for REST and the command line: use, growth, damage, and what would be deleted."""

from __future__ import annotations

import asyncio
import shutil
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from gateway.store.engine import StoreEngine
from gateway.store.forecast import ClassFlow, forecast
from gateway.store.integrity.check import Damage
from gateway.store.objects import DirectoryStore, ObjectStore
from gateway.store.purge import plan_of
from gateway.store.retention import Retention
from gateway.store.stats import ClassUse, Stats, read_stats
from gateway.store.store import Store
from metaros.clock import Clock

__all__ = ["Storage", "StorageManager", "damage_document"]

_DAMAGE = 100
_FRESH_S = 10.0  # an account goes through every table


@dataclass(frozen=True, slots=True, kw_only=True)
class Storage:
    """What must be known of a store beside its tables."""

    retention: Retention
    objects: ObjectStore
    data_dir: Path

    def document(self, engine: StoreEngine, *, now_ns: int) -> dict[str, Any]:
        """The answer of GET /api/v1/store."""
        stats = read_stats(engine, now_ns=now_ns)
        free = self._free_bytes(engine)
        flows = [self._flow(engine, use) for use in stats.classes]
        known = all(use.bytes_per_day is not None for use in stats.classes)
        ahead = forecast(
            flows, total_bytes=stats.total_bytes, keep_bytes=self.retention.size_bytes, disk_free_bytes=free
        )
        return {
            "total_bytes": stats.total_bytes,
            "keep_bytes": self.retention.size_bytes,
            "disk_free_bytes": free,
            "growth_bytes_per_day": round(sum(flow.bytes_per_day for flow in flows)) if known else None,
            "days_until_bound": ahead.until_bound if known else None,
            "days_until_full": ahead.until_full if known else None,
            "classes": [self._class_document(use) for use in stats.classes],
            "robots": [{"robot": robot, "bytes": size_bytes} for robot, size_bytes in stats.robots],
            "tables": [{"table": use.name, "rows": use.rows, "bytes": use.size_bytes} for use in stats.tables],
            "objects": self._objects_document(stats),
            "damaged": [damage_document(item) for item in stats.checked.damage[:_DAMAGE]] if stats.checked else [],
            "checked": _time(stats.checked.checked_ns) if stats.checked else None,
        }

    def plan_document(self, engine: StoreEngine, *, now_ns: int) -> dict[str, Any]:
        """The answer of GET /api/v1/store/retention: what the purge's own plan says now."""
        groups: dict[tuple[str, str], list[int]] = {}
        for going in plan_of(engine, self.retention, now_ns=now_ns):
            held = going.holding
            group = groups.setdefault((held.kind, going.why), [0, 0, held.stored_ns, held.stored_ns])
            group[0] += 1
            group[1] += held.size_bytes
            group[2], group[3] = min(group[2], held.stored_ns), max(group[3], held.stored_ns)
        with engine.transaction(write=False):
            before_ns = self.retention.gaps_before_ns(now_ns=now_ns)
            gaps = engine.fetch("SELECT count(*) FROM gaps WHERE stored_ns < ?", before_ns)[0][0]
        items = [
            {
                "class": name,
                "why": why,
                "count": count,
                "bytes": size_bytes,
                "oldest": _time(oldest),
                "newest": _time(newest),
            }
            for (name, why), (count, size_bytes, oldest, newest) in groups.items()
        ]
        return {"items": items, "bytes": sum(group[1] for group in groups.values()), "gaps": int(gaps)}

    def _class_document(self, use: ClassUse) -> dict[str, Any]:
        limit = self.retention.limit(use.name)
        return {
            "class": use.name,
            "bytes": use.size_bytes,
            "oldest": _time(use.oldest_ns) if use.oldest_ns is not None else None,
            "keep_days": limit.age_s / 86400 if limit.age_s is not None else None,
            "keep_bytes": limit.size_bytes,
        }

    def _objects_document(self, stats: Stats) -> dict[str, Any]:
        use = stats.objects
        return {
            "where": self.objects.where,
            "stored": use.stored,
            "bytes": use.size_bytes,
            "uploading": use.uploading,
            "doomed": use.doomed,
        }

    def _flow(self, engine: StoreEngine, use: ClassUse) -> ClassFlow:
        limit = self.retention.limit(use.name)
        in_rows = use.name == "metric"  # all else ends as objects
        return ClassFlow(
            size_bytes=use.size_bytes,
            bytes_per_day=use.bytes_per_day or 0.0,
            keep_days=limit.age_s / 86400 if limit.age_s is not None else None,
            keep_bytes=limit.size_bytes,
            local=not engine.shared if in_rows else isinstance(self.objects, DirectoryStore),
        )

    def _free_bytes(self, engine: StoreEngine) -> int | None:
        """Of the disk of what lies on this machine, the fuller one if there are two; None when nothing does."""
        places = [] if engine.shared else [self.data_dir]
        if isinstance(self.objects, DirectoryStore):
            places.append(Path(self.objects.where))
        found = [next(each for each in (place, *place.absolute().parents) if each.exists()) for place in places]
        return min((shutil.disk_usage(place).free for place in found), default=None)


class StorageManager:
    """The account of the gateway's own store, read off the event loop; an answer serves everybody for 10 s."""

    def __init__(self, store: Store, storage: Storage, *, clock: Clock) -> None:
        self._store = store
        self._storage = storage
        self._clock = clock
        self._read_s = -1e9
        self._document: dict[str, Any] = {}
        self._one = asyncio.Lock()

    async def document(self) -> dict[str, Any]:
        """The answer of GET /api/v1/store; StoreError when the database cannot be read."""
        async with self._one:
            if self._clock.monotonic_s() - self._read_s >= _FRESH_S:
                now_ns = self._clock.wall_ns()
                self._document = await self._store.read(lambda engine: self._storage.document(engine, now_ns=now_ns))
                self._read_s = self._clock.monotonic_s()
            return self._document

    async def plan(self) -> dict[str, Any]:
        """The answer of GET /api/v1/store/retention."""
        async with self._one:
            now_ns = self._clock.wall_ns()
            return await self._store.read(lambda engine: self._storage.plan_document(engine, now_ns=now_ns))


def damage_document(damage: Damage) -> dict[str, Any]:
    """One finding of a check."""
    return {
        "object": damage.object,
        "robot": damage.robot,
        "topic": damage.topic,
        "start": _time(damage.first_ns) if damage.first_ns is not None else None,
        "end": _time(damage.last_ns) if damage.last_ns is not None else None,
        "what": f"{damage.what}: {damage.detail}",
    }


def _time(time_ns: int) -> str:
    """RFC 3339, to the millisecond."""
    seconds, rest_ns = divmod(time_ns, 10**9)
    text = datetime.fromtimestamp(seconds, UTC).strftime("%Y-%m-%dT%H:%M:%S")
    return f"{text}.{rest_ns // 10**6:03d}Z"
