"""Which process of this machine a node lives in, and how busy that is.

A session's link tells the TCP port that the peer at its other end uses; the system tells whose port that is. Where
either does not tell (no psutil, another machine, another user's process, macOS without rights) there is no answer.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from metaros.wire import WireSession

__all__ = ["Processes", "Usage"]


class Usage(NamedTuple):
    """A process's number and its share of one CPU since the last look."""

    pid: int
    cpu_percent: float


class Processes:
    """Ask `look` again and again; the first answer of a process has no share yet."""

    def __init__(self, session: WireSession) -> None:
        self._session = session
        self._pids: dict[str, int] = {}  # by Zenoh id; nothing more is learnt of one that is known
        self._asked: set[str] = set()
        self._known: dict[int, Any] = {}
        try:
            import psutil
        except ImportError:
            self._psutil: Any = None
        else:
            self._psutil = psutil

    def look(self) -> dict[str, Usage]:
        """By the Zenoh id of their session."""
        if self._psutil is None:
            return {}
        ends = self._ends()
        if ends.keys() - self._asked:  # listing connections costs: only when somebody is new
            self._asked |= ends.keys()
            self._pids |= self._owners(ends)
        found = {}
        for zid in ends:
            pid = self._pids.get(zid)
            if pid is not None and (share := self._share(pid)) is not None:
                found[zid] = Usage(pid, share)
        return found

    def _ends(self) -> dict[str, tuple[int, int]]:
        """Ports of the links to each peer on this machine: its and ours."""
        ends = {}
        for link in getattr(self._session.zenoh.info, "links", list)():
            there, here = str(link.dst), str(link.src)
            if there.startswith("tcp/") and _host(there) == _host(here):
                ends[str(link.zid)] = _port(there), _port(here)
        return ends

    def _owners(self, ends: dict[str, tuple[int, int]]) -> dict[str, int]:
        try:
            connections = self._psutil.net_connections(kind="tcp")
        except (self._psutil.Error, OSError):
            return {}
        owners = {(item.laddr[1], item.raddr[1]): item.pid for item in connections if item.pid and item.raddr}
        return {zid: owners[pair] for zid, pair in ends.items() if pair in owners}

    def _share(self, pid: int) -> float | None:
        try:
            if pid not in self._known:
                self._known[pid] = self._psutil.Process(pid)
            return float(self._known[pid].cpu_percent())
        except (self._psutil.Error, OSError):
            return None


def _host(locator: str) -> str:
    return locator.partition("/")[2].rpartition(":")[0]


def _port(locator: str) -> int:
    port = locator.partition("?")[0].rpartition(":")[2]
    return int(port) if port.isdigit() else 0
