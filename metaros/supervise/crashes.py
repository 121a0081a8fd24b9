"""Crash reports: how a node ended the last times, with its last words; kept over the supervisor's own end."""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
from collections import deque
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Final

from metaros.limits import LIMITS
from metaros.supervise.node_table_file import write_whole

__all__ = ["KEPT", "Crashes", "core_of"]

LOG = logging.getLogger("metaros.supervisor")
KEPT: Final = LIMITS.node_crashes  # of one node
_LINE_CHARS: Final = 500
_FILE_BYTES: Final = 1024 * 1024
_VALUE_CHARS: Final = 500
_CORE: Final = ("PATH", "PYTHONPATH", "LD_LIBRARY_PATH", "LANG", "HOME", "USER", "VIRTUAL_ENV", "RMW_IMPLEMENTATION")
_CORE_BEGINS: Final = ("ROS_", "METAROS_", "ZENOH_")
_SECRET: Final = ("TOKEN", "KEY", "SECRET", "PASS", "CREDENTIAL", "HEARTBEAT")


def core_of(env: Mapping[str, str]) -> dict[str, str]:
    """Of an environment what explains a crash, without what may be a secret."""
    return {
        name: value[:_VALUE_CHARS]
        for name, value in sorted(env.items())
        if (name in _CORE or name.startswith(_CORE_BEGINS)) and not any(word in name.upper() for word in _SECRET)
    }


class Crashes:
    """The last reports of each node, newest last. What is new is written by a thread, soon."""

    def __init__(self, directory: Path) -> None:
        self._directory = directory
        self._reports: dict[str, deque[dict[str, Any]]] = {}
        self._new: set[str] = set()
        self._writing: asyncio.Task[None] | None = None

    def of(self, node: str) -> list[dict[str, Any]]:
        """Its reports, oldest first."""
        return list(self._kept(node))

    def add(self, node: str, *, lines: Iterable[str], **facts: Any) -> None:
        """One more."""
        self._kept(node).append({**facts, "lines": [line[:_LINE_CHARS] for line in lines]})
        self._new.add(node)
        if self._writing is None:
            self._writing = asyncio.create_task(self._write())

    def forget(self, node: str) -> None:
        """The node is gone from the table."""
        self._reports.pop(node, None)
        self._new.discard(node)
        with contextlib.suppress(OSError):
            self._path(node).unlink(missing_ok=True)

    async def close(self) -> None:
        """Until all is written."""
        if self._writing is not None:
            await self._writing

    def _kept(self, node: str) -> deque[dict[str, Any]]:
        if node not in self._reports:
            self._reports[node] = deque(self._read(node), maxlen=KEPT)
        return self._reports[node]

    def _path(self, node: str) -> Path:
        return self._directory / f"{node}.json"

    def _read(self, node: str) -> list[dict[str, Any]]:
        try:
            with self._path(node).open("rb") as file:
                found = json.loads(file.read(_FILE_BYTES))
        except (OSError, ValueError, RecursionError):
            return []
        return [item for item in found if isinstance(item, dict)] if isinstance(found, list) else []

    async def _write(self) -> None:
        try:
            while self._new:
                node = self._new.pop()
                data = json.dumps(list(self._kept(node)), indent=1).encode()
                await asyncio.to_thread(self._put, self._path(node), data)
        finally:
            self._writing = None

    def _put(self, path: Path, data: bytes) -> None:
        try:
            path.parent.mkdir(mode=0o700, exist_ok=True)
            write_whole(path, data)
        except OSError as error:  # a full disk: the reports live in memory
            LOG.warning("cannot keep a crash report: %s", error)
