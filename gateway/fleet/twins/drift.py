"""Drift detection: a robot's nodes no longer match its twin. Reported as it begins and as it ends."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import lru_cache
from itertools import islice
from typing import Any, Final

from gateway.domain.fleet.node import Difference, TwinStanding, node_state
from gateway.domain.fleet.twin import Reported
from gateway.fleet.twins.cache import TwinCache, reported_values
from metaros.fleet.twin import TwinError, parse
from metaros.fleet.twin.document import NodeSpec
from metaros.fleet.twin.tables import MAX_NODES

__all__ = ["Drift", "Emit"]

Emit = Callable[[str, str, Mapping[str, Any]], None]  # kind, robot, data
Holder = Callable[[str, str], str | None]
MOST_TOLD: Final = 32  # nodes of one event
DOCUMENTS: Final = 64  # read ones that are kept; a fleet has few different ones


class Drift:
    """Watches reports (`TwinCache.watch`); on the event loop.

    Only reports of one revision that is desired and applied are held against each other: what a change brings about is
    no drift. A node that was never as desired has not drifted either; its own events tell of it.
    """

    def __init__(self, cache: TwinCache, emit: Emit, *, holder_of: Holder) -> None:
        self._cache = cache
        self._emit = emit
        self._holder_of = holder_of

    def on_report(self, before: Reported | None, after: Reported) -> None:
        """A robot reported what it is, and what it reported before."""
        desired = self._cache.desired.get(after.robot)
        if desired is None or before is None or before.reported == after.reported:
            return
        if not before.reported or not all(_settled(item, desired.revision) for item in (before, after)):
            return
        wanted = _nodes(desired.document)
        if wanted is None:
            return
        was, now = (self._differing(item, wanted) for item in (before, after))
        if was is None or now is None:
            return
        if now and not was:
            nodes = [
                {"node": name, "what": found.what, "desired": found.desired, "reported": found.reported}
                | {"why": found.why}
                for name, found in list(now.items())[:MOST_TOLD]
            ]
            self._emit("twin.drifted", after.robot, {"revision": after.revision, "count": len(now), "nodes": nodes})
        elif was and not now:
            self._emit("twin.in_step", after.robot, {"revision": after.revision})

    def _differing(self, item: Reported, wanted: Mapping[str, NodeSpec]) -> dict[str, Difference] | None:
        """The first thing of each node that is not as desired; None where the robot left its nodes out."""
        found = reported_values(item).get("nodes")
        if not isinstance(found, dict):
            return None
        rows = {name: row for name, row in islice(found.items(), MAX_NODES) if isinstance(row, dict)}
        standing = TwinStanding(
            robot=item.robot,
            online=True,
            reported_ns=item.at_ns,
            revision=item.revision,
            applied=item.applied,
            state=item.state,
        )
        differing = {}
        for name in sorted({*wanted, *rows}):
            desired = wanted.get(name)
            holder = self._holder_of(item.robot, name) if desired is not None and desired.migratable else None
            state = node_state(name, desired, rows.get(name), standing, holder=holder)
            if state.differs:
                differing[name] = state.differs[0]
        return differing


def _settled(item: Reported, revision: int) -> bool:
    """Whether the robot says that it lives by what is desired."""
    return item.state == "applied" and item.revision == item.applied == revision


@lru_cache(maxsize=DOCUMENTS)
def _nodes(document: bytes) -> Mapping[str, NodeSpec] | None:
    """The nodes that a document wants; None where it says nothing of nodes, or an older gateway stored it."""
    try:
        return parse(document).nodes
    except TwinError:
        return None
