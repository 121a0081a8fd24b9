"""The two tables of `metaros top`: rows from the graph and what was measured. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from metaros.cli.shared.topic_rates import TopicRates
from metaros.cli.top.drops import DropRow

if TYPE_CHECKING:
    from metaros.cli.top.processes import Usage
    from metaros.wire import EndpointInfo, NodeInfo

__all__ = ["NodeRow", "Screenful", "TopicRow", "node_rows", "topic_rows"]

SORTS = {
    "name": lambda row: row.topic,
    "rate": lambda row: (-row.rate_hz, row.topic),
    "bandwidth": lambda row: (-row.bytes_per_s, row.topic),
}


@dataclass(frozen=True, slots=True)
class TopicRow:
    """One topic."""

    topic: str
    type: str
    rate_hz: float
    bytes_per_s: float
    publishers: int
    subscribers: int


@dataclass(frozen=True, slots=True)
class NodeRow:
    """One node; `pid` and `cpu_percent` of its process where the system tells (several nodes may share one)."""

    node: str
    publishers: int
    subscribers: int
    services: int
    pid: int | None = None
    cpu_percent: float | None = None


@dataclass(frozen=True, slots=True)
class Screenful:
    """What is shown at a time."""

    topics: tuple[TopicRow, ...]
    nodes: tuple[NodeRow, ...]
    mismatches: int
    subscriptions: tuple[DropRow, ...] = ()  # of Meta-ROS nodes, who misses most first

    @property
    def dropping(self) -> tuple[DropRow, ...]:
        """Those that missed any message."""
        return tuple(row for row in self.subscriptions if row.missing)


def topic_rows(
    ends: Iterable[EndpointInfo], rates: Mapping[str, TopicRates], *, word: str = "", sort: str = "name"
) -> tuple[TopicRow, ...]:
    """All topics whose name contains `word`."""
    by_topic: dict[str, list[EndpointInfo]] = {}
    for item in ends:
        if item.kind in ("MP", "MS") and word in item.topic:
            by_topic.setdefault(item.topic, []).append(item)
    rows = []
    for topic, own in by_topic.items():
        kinds = [item.kind for item in own]
        types = " ".join(sorted({item.type_name for item in own}))
        rate = rates.get(topic, TopicRates(0.0, 0.0))
        rows.append(TopicRow(topic, types, rate.hz, rate.bytes_per_s, kinds.count("MP"), kinds.count("MS")))
    return tuple(sorted(rows, key=SORTS[sort]))


def node_rows(
    nodes: Iterable[NodeInfo], ends: Iterable[EndpointInfo], usage: Mapping[str, Usage], *, word: str = ""
) -> tuple[NodeRow, ...]:
    """All nodes whose name contains `word`."""
    kinds: dict[tuple[str, str], list[str]] = {}
    for item in ends:
        kinds.setdefault((item.zid, item.node_full_name), []).append(item.kind)
    rows = []
    for node in nodes:
        if word in node.full_name:
            own, used = kinds.get((node.zid, node.full_name), []), usage.get(node.zid)
            counts = own.count("MP"), own.count("MS"), own.count("SS")
            rows.append(NodeRow(node.full_name, *counts, *((used.pid, used.cpu_percent) if used else (None, None))))
    return tuple(sorted(rows, key=lambda row: row.node))
