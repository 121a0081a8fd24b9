"""Aggregated metrics of all robots: sums, quantiles, and the ones that lag most. Pure."""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Sequence
from typing import Final, Protocol

from gateway.domain.channel import CLASSES
from gateway.ops.meters import Families

__all__ = ["Counted", "FleetView"]

_QUANTILES: Final = (0.5, 0.9, 0.99, 1.0)


class Counted(Protocol):
    """What arrived from a robot since the gateway started."""

    samples: int
    bytes: int
    duplicates: int
    gaps: int
    lost: int
    over_quota: int
    put_off: int


class FleetView:
    """Robots are added one after the other; `most` of them get series of their own."""

    def __init__(self, *, most: int) -> None:
        self._most = most
        self._sums = dict.fromkeys(("samples", "bytes", "duplicates", "gaps", "lost", "over_quota", "put_off"), 0)
        self._online = self._offline = self._remote = self._backlog_bytes = 0
        self._lost = dict.fromkeys(CLASSES.values(), 0)
        self._lags: list[tuple[float, str]] = []
        self._backlogs: list[tuple[int, str]] = []
        self._rtts: list[float] = []

    def add(
        self, robot: str, online: bool, counts: Counted, lag_s: float | None, rtt_s: float | None, backlog_bytes: int
    ) -> None:
        """One robot; what it lags and holds counts while it is online, since nobody knows it otherwise."""
        self._sum(counts)
        self._backlog_bytes += backlog_bytes
        if not online:
            self._offline += 1
            return
        self._online += 1
        self._backlogs.append((backlog_bytes, robot))
        if lag_s is not None:
            self._lags.append((lag_s, robot))
        if rtt_s is not None:
            self._rtts.append(rtt_s)

    def add_remote(self, counts: Counted, *, online: bool) -> None:
        """One that is linked to another gateway, or was there last, which says how it is. What came here counts."""
        self._sum(counts)
        self._remote += online
        self._offline += not online

    def lost(self, classes: Iterable[tuple[str, int]]) -> None:
        """What a robot's agent has given up, by class; names that are no class of ours count for nothing."""
        for name, samples in classes:
            if name in self._lost:
                self._lost[name] += samples

    def put(self, found: Families) -> None:
        """Write the numbers."""
        found.put("metaros_robots", self._online, "online")
        found.put("metaros_robots", self._remote, "elsewhere")
        found.put("metaros_robots", self._offline, "offline")
        for name, metric in _SUMS.items():
            found.put(metric, self._sums[name])
        found.put("metaros_backlog_bytes", self._backlog_bytes)
        for delivery, samples in self._lost.items():
            found.put("metaros_agent_lost_samples", samples, delivery)
        _quantiles(found, "metaros_link_rtt_seconds", self._rtts)
        _quantiles(found, "metaros_lag_seconds", [lag_s for lag_s, _ in self._lags])
        for lag_s, robot in heapq.nlargest(self._most, self._lags):
            found.put("metaros_robot_lag_seconds", lag_s, robot)
        for backlog, robot in heapq.nlargest(self._most, self._backlogs):
            found.put("metaros_robot_backlog_bytes", backlog, robot)

    def _sum(self, counts: Counted) -> None:
        for name in self._sums:
            self._sums[name] += getattr(counts, name)


_SUMS: Final = {
    "samples": "metaros_link_samples",
    "bytes": "metaros_link_bytes",
    "duplicates": "metaros_link_duplicates",
    "gaps": "metaros_link_gaps",
    "lost": "metaros_link_lost_samples",
    "over_quota": "metaros_link_over_quota_samples",
    "put_off": "metaros_link_put_off",
}


def _quantiles(found: Families, name: str, values: Sequence[float]) -> None:
    """Of the values' order; nothing where there are none."""
    ordered = sorted(values)
    for quantile in _QUANTILES if ordered else ():
        index = min(len(ordered) - 1, int(quantile * len(ordered)))
        found.put(name, ordered[index], f"{quantile:g}")
