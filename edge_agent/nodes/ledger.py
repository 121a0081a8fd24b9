"""Persistent record of which version of each node's bundle proved itself, and which failed."""

from __future__ import annotations

import json
import logging
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Final

from edge_agent.nodes.version_trial import VersionTrial
from metaros.supervise.node_table_file import write_whole

__all__ = ["Ledger"]

LOG = logging.getLogger("metaros.agent.nodes")
NAME: Final = "nodes.json"
_KEPT: Final = ("bundle", "good", "failed", "code", "message")
_NODES: Final = 1024


class Ledger:
    """One file in the state directory; a damaged one is as none."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory
        self._path = directory / NAME
        self._trials = self._read()
        self._written = b""

    def trial(self, node: str, bundle: str) -> VersionTrial:
        """Of a node; another bundle begins anew."""
        found = self._trials.get(node)
        if found is None or found.bundle != bundle:
            found = self._trials[node] = VersionTrial(bundle)
            while len(self._trials) > _NODES:
                del self._trials[next(iter(self._trials))]
        return found

    def keep(self) -> None:
        """Write it, where something is new; a disk that refuses costs a second trial."""
        rows = {node: {key: asdict(trial)[key] for key in _KEPT} for node, trial in self._trials.items()}
        data = json.dumps(rows, indent=1).encode()
        if data == self._written or (not rows and not self._path.exists()):
            return
        try:
            write_whole(self._path, data)
            self._written = data
        except OSError as error:
            LOG.warning("cannot keep which bundles are good: %s", error)

    def _read(self) -> dict[str, VersionTrial]:
        try:
            found = json.loads(self._path.read_bytes())
            return {str(node): _trial(row) for node, row in list(found.items())[:_NODES]}
        except FileNotFoundError:
            return {}
        except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
            LOG.warning("%s: %s; every bundle has to prove itself again", self._path, error)
            return {}


def _trial(row: Mapping[str, object]) -> VersionTrial:
    bundle, good, failed, code, message = (str(row[key]) for key in _KEPT)
    return VersionTrial(bundle, good=good, failed=failed, code=code, message=message)
