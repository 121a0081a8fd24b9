"""Limits on the connections of the HTTP port: how many there may be, and how long one may keep the gateway waiting.

A connection is counted from its accept on, before TLS. Where there is no room, the one that has waited longest for its
next request is closed, so that idle connections keep nobody out; where all are busy, the new one is closed. Lives on
the event loop; `sweep` ends who is late.
"""

from __future__ import annotations

import asyncio
import math
import sys
from collections.abc import Callable
from dataclasses import dataclass, field

from gateway.identity.lockout import address_group
from metaros.clock import Clock
from metaros.limits import LIMITS, Limits

__all__ = ["Connection", "ConnectionLimits", "open_files"]

SWEEP_S = 1.0
LEAST_TAKEN_BYTES = 64 * 1024
LOCAL_SHARE = 0.75


@dataclass(eq=False, slots=True)
class Connection:
    """One connection."""

    address: str
    transport: asyncio.Transport
    deadline_s: float = math.inf
    write_paused: bool = False  # its transport takes nothing more before the other end has read
    backlog_bytes: int = 0  # of an answer, when it was last seen to shrink; 0: there is none
    backlog_s: float = 0.0


@dataclass(slots=True)
class _Address:
    """The connections of one address."""

    count: int = 0
    waiting: dict[Connection, None] = field(default_factory=dict)


class ConnectionLimits:
    """Counts the connections of one port, and ends those that are too many or too slow."""

    def __init__(
        self,
        *,
        clock: Clock,
        limits: Limits = LIMITS,
        is_shared: Callable[[str], bool] = lambda address: False,
        files: int | None = None,
    ) -> None:
        """`is_shared` says of which addresses many come: this machine, proxies. `files` is how many may be open."""
        self.limits = limits
        self._clock = clock
        self._is_shared = is_shared
        self._most = limits.connections if files is None else max(8, min(limits.connections, files // 2))
        self._by_transport: dict[asyncio.BaseTransport, Connection] = {}
        self._waiting: dict[Connection, None] = {}
        self._addresses: dict[str, _Address] = {}

    def __len__(self) -> int:
        return len(self._by_transport)

    def add(self, transport: asyncio.Transport) -> Connection | None:
        """Count a new connection, which waits for its first request; None: too many, it has to be closed."""
        peer = transport.get_extra_info("peername")
        name = str(peer[0]) if isinstance(peer, tuple) else ""
        address = address_group(name)
        theirs = self._addresses.get(address) or _Address()
        most = round(self._most * LOCAL_SHARE) if self._is_shared(name) else self.limits.connections_address
        if theirs.count >= most and not self._evict(theirs.waiting):
            return None
        if len(self._by_transport) >= self._most and not self._evict(self._waiting):
            return None
        connection = Connection(address, transport)
        self._by_transport[transport] = connection
        self._addresses.setdefault(address, theirs).count += 1
        self.mark_idle(connection, self.limits.head_s)
        return connection

    def find(self, transport: asyncio.BaseTransport) -> Connection | None:
        """The connection of a transport."""
        return self._by_transport.get(transport)

    def secured(self, connection: Connection, transport: asyncio.Transport) -> None:
        """The connection speaks TLS now."""
        if self._by_transport.pop(connection.transport, None) is not None:
            connection.transport = transport
            self._by_transport[transport] = connection

    def mark_idle(self, connection: Connection, seconds: float) -> None:
        """It has no request under way, and so long for what comes next."""
        if connection.transport in self._by_transport:
            connection.deadline_s = self._clock.monotonic_s() + seconds
            self._waiting[connection] = self._addresses[connection.address].waiting[connection] = None

    def mark_busy(self, connection: Connection) -> None:
        """A request of it is under way, or a WebSocket is open: no deadline."""
        if connection.transport in self._by_transport:
            connection.deadline_s = math.inf
            self._waiting.pop(connection, None)
            self._addresses[connection.address].waiting.pop(connection, None)

    def remove(self, connection: Connection) -> None:
        """It has ended; more than once does nothing."""
        if self._by_transport.pop(connection.transport, None) is None:
            return
        self._waiting.pop(connection, None)
        theirs = self._addresses[connection.address]
        theirs.waiting.pop(connection, None)
        theirs.count -= 1
        if not theirs.count:
            del self._addresses[connection.address]

    def sweep(self) -> None:
        """Abort who is late with a head, a handshake or the rest of a body, and who takes nothing of an answer."""
        now_s = self._clock.monotonic_s()
        for connection in list(self._by_transport.values()):
            if now_s >= connection.deadline_s or self._stalled(connection, now_s):
                self._abort(connection)

    def close(self) -> None:
        """Abort all connections."""
        for connection in list(self._by_transport.values()):
            self._abort(connection)

    async def run(self) -> None:
        """Sweep periodically, until cancelled."""
        while True:
            await asyncio.sleep(SWEEP_S)
            self.sweep()

    def _stalled(self, connection: Connection, now_s: float) -> bool:
        if not (connection.write_paused or connection.transport.is_closing()):
            connection.backlog_bytes = 0
            return False
        size = connection.transport.get_write_buffer_size()  # nothing is put in now: what it loses was taken
        if not connection.backlog_bytes or size <= connection.backlog_bytes - LEAST_TAKEN_BYTES:
            connection.backlog_bytes, connection.backlog_s = max(1, size), now_s
        return now_s - connection.backlog_s >= self.limits.answer_stall_s

    def _evict(self, waiting: dict[Connection, None]) -> bool:
        connection = next(iter(waiting), None)
        if connection is None:
            return False
        self._abort(connection)
        return True

    def _abort(self, connection: Connection) -> None:
        self.remove(connection)
        connection.transport.abort()


def open_files(most: int = 65_536) -> int | None:
    """Let this process open as many files as the system allows, up to `most`; how many that are, None: no bound.

    Every connection is a file, and the usual 1024 are soon taken.
    """
    if sys.platform == "win32":  # it has no such bound
        return None
    else:
        import resource

        soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
        wanted = most if hard == resource.RLIM_INFINITY else min(most, hard)
        if soft != resource.RLIM_INFINITY and soft < wanted:
            resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))
            return wanted
        return None if soft == resource.RLIM_INFINITY else soft
