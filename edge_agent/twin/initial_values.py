"""Parameters and lifecycle states of nodes before the twin changed them, so that a rollback restores them.

Kept on disk before the first change, as a crash must not make the twin's values look like the node's own. They are
good for one life of the node: started again it has the values of its own start.
"""

from __future__ import annotations

import asyncio
import json
from dataclasses import dataclass, field
from typing import Any, Final

from edge_agent.errors import DiskError
from edge_agent.outbox import Disk
from metaros.limits import LIMITS

__all__ = ["InitialValues", "NodeInitialValues"]

FILE: Final = "twin/originals.json"


@dataclass(slots=True)
class NodeInitialValues:
    """The initial values of one run of a node."""

    life: str
    parameters: dict[str, Any] = field(default_factory=dict)
    lifecycle: str = ""
    guessed: bool = False  # taken over from the life before: what is not the twin's now is the node's own


class InitialValues:
    """The initial values of all nodes. Reading never fails: what cannot be read is not known."""

    def __init__(self, disk: Disk) -> None:
        self._disk = disk
        self.nodes: dict[str, NodeInitialValues] = {}
        self._turn = asyncio.Lock()
        self._kept = b"{}"
        try:
            size = self._disk.size(FILE)
            rows = json.loads(self._disk.read(FILE, 0, size)) if 0 < size <= LIMITS.twin_originals_bytes else {}
            self.nodes = {
                str(node): NodeInitialValues(str(row["life"]), dict(row["parameters"]), str(row["lifecycle"]))
                for node, row in rows.items()
            }
        except (DiskError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
            self.nodes = {}

    def of(self, node: str, life: str) -> NodeInitialValues:
        """That of a node's life; an empty one, and the one of an earlier life forgotten."""
        known = self.nodes.get(node)
        if known is None or known.life != life:
            known = self.nodes[node] = NodeInitialValues(life)
        return known

    async def keep(self) -> None:
        """On the disk when this returns. Raises DiskError, also where it is too much."""
        async with self._turn:
            data = self._data()
            if data != self._kept:
                await asyncio.to_thread(self._disk.replace, FILE, data)
                self._kept = data

    def _data(self) -> bytes:
        used = {node: row for node, row in self.nodes.items() if row.parameters or row.lifecycle}
        rows = {
            node: {"life": row.life, "parameters": row.parameters, "lifecycle": row.lifecycle}
            for node, row in used.items()
        }
        data = json.dumps(rows, default=_plain).encode()
        if len(data) > LIMITS.twin_originals_bytes:
            raise DiskError(f"the nodes' own values are more than {LIMITS.twin_originals_bytes} bytes")
        return data


def _plain(value: Any) -> list[int]:
    """Bytes as a list of numbers: no twin can set them, so that they are never set back."""
    return list(value)
