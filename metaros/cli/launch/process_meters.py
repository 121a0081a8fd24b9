"""How busy and how large the launched processes are; nothing where psutil is missing."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

__all__ = ["Meters", "Usage"]


class Usage(NamedTuple):
    """A process's share of one CPU since the last look, and its resident memory."""

    cpu_percent: float
    memory_bytes: int


class Meters:
    """Ask `look` again and again; a process's first answer has no share yet."""

    def __init__(self) -> None:
        self._known: dict[int, Any] = {}
        try:
            import psutil
        except ImportError:
            self._psutil: Any = None
        else:
            self._psutil = psutil

    def look(self, pids: Mapping[str, int]) -> dict[str, Usage]:
        """By the names of the nodes."""
        if self._psutil is None:
            return {}
        self._known = {pid: known for pid, known in self._known.items() if pid in pids.values()}
        found = {}
        for name, pid in pids.items():
            try:
                process = self._known.get(pid) or self._known.setdefault(pid, self._psutil.Process(pid))
                with process.oneshot():
                    found[name] = Usage(process.cpu_percent(None), process.memory_info().rss)
            except self._psutil.Error:  # it has just gone, or is not ours to look at
                self._known.pop(pid, None)
        return found
