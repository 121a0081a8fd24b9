"""Loads stored robots into the registry when the gateway starts."""

from __future__ import annotations

from gateway.ingest.registry import Registry, RobotRecord, SeriesState
from gateway.store import Store

__all__ = ["load_robots"]

LOADED_ROBOTS = 256  # of how many robots the newest values are read at start


async def load_robots(store: Store, registry: Registry) -> None:
    """Let the registry know every robot that ever connected, and the newest values of those that were here last."""
    stored = sorted(await store.robots(), key=lambda item: -item.last_seen_ns)
    for position, item in enumerate(stored):
        record = registry.add(RobotRecord(item.robot, seen_ns=item.last_seen_ns))
        if position < LOADED_ROBOTS:
            for facts in await store.series(item.robot.id):
                state = SeriesState(facts.series, facts.samples, facts.stamp_ns, facts.value)
                record.series[facts.series.name] = state
