"""Everybody connected to the HTTP port: how many there may be, and how long one may keep the gateway waiting.

A connection is counted from its accept on, before TLS. Where there is no room, the one that has waited longest for its
next request goes, so that those who only hold places keep nobody out; where all are busy, the new one goes. Lives on
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

__all__ = ["Crowd", "Guest", "open_files"]

SWEEP_S = 1.0
LEAST_TAKEN_BYTES = 64 * 1024
LOCAL_SHARE = 0.75


@dataclass(eq=False, slots=True)
class Guest:
    """One connection."""

    address: str
    transport: asyncio.Transport
    deadline_s: float = math.inf
    full: bool = False  # its transport takes nothing more before the other end has read
    backlog_bytes: int = 0  # of an answer, when it was last seen to shrink; 0: there is none
    backlog_s: float = 0.0


@dataclass(slots=True)
class _Address:
    """The connections of one address."""

    count: int = 0
    waiting: dict[Guest, None] = field(default_factory=dict)


class Crowd:
    """The connections of one port."""

    def __init__(
        self,
        *,
        clock: Clock,
        limits: Limits = LIMITS,
        roomy: Callable[[str], bool] = lambda address: False,
        files: int | None = None,
    ) -> None:
        """`roomy` says of which addresses many come: this machine, proxies. `files` is how many may be open."""
        self.limits = limits
        self._clock = clock
        self._roomy = roomy
        self._most = limits.connections if files is None else max(8, min(limits.connections, files // 2))
        self._guests: dict[asyncio.BaseTransport, Guest] = {}
        self._waiting: dict[Guest, None] = {}
        self._addresses: dict[str, _Address] = {}

    def __len__(self) -> int:
        return len(self._guests)

    def enter(self, transport: asyncio.Transport) -> Guest | None:
        """Count a new connection in, which waits for its first request; None: there is no room, it has to go."""
        peer = transport.get_extra_info("peername")
        name = str(peer[0]) if isinstance(peer, tuple) else ""
        address = address_group(name)
        theirs = self._addresses.get(address) or _Address()
        most = round(self._most * LOCAL_SHARE) if self._roomy(name) else self.limits.connections_address
        if theirs.count >= most and not self._evict(theirs.waiting):
            return None
        if len(self._guests) >= self._most and not self._evict(self._waiting):
            return None
        guest = Guest(address, transport)
        self._guests[transport] = guest
        self._addresses.setdefault(address, theirs).count += 1
        self.wait(guest, self.limits.head_s)
        return guest

    def of(self, transport: asyncio.BaseTransport) -> Guest | None:
        """Whose transport that is."""
        return self._guests.get(transport)

    def secured(self, guest: Guest, transport: asyncio.Transport) -> None:
        """The connection speaks TLS now."""
        if self._guests.pop(guest.transport, None) is not None:
            guest.transport = transport
            self._guests[transport] = guest

    def wait(self, guest: Guest, seconds: float) -> None:
        """It has nothing under way, and so long for what comes next."""
        if guest.transport in self._guests:
            guest.deadline_s = self._clock.monotonic_s() + seconds
            self._waiting[guest] = self._addresses[guest.address].waiting[guest] = None

    def work(self, guest: Guest) -> None:
        """A request of it is under way, or a socket is open."""
        if guest.transport in self._guests:
            guest.deadline_s = math.inf
            self._waiting.pop(guest, None)
            self._addresses[guest.address].waiting.pop(guest, None)

    def leave(self, guest: Guest) -> None:
        """It is gone; more than once does nothing."""
        if self._guests.pop(guest.transport, None) is None:
            return
        self._waiting.pop(guest, None)
        theirs = self._addresses[guest.address]
        theirs.waiting.pop(guest, None)
        theirs.count -= 1
        if not theirs.count:
            del self._addresses[guest.address]

    def sweep(self) -> None:
        """Cut who is late with a head, a handshake or the rest of a body, and who takes nothing of an answer."""
        now_s = self._clock.monotonic_s()
        for guest in list(self._guests.values()):
            if now_s >= guest.deadline_s or self._stalled(guest, now_s):
                self._cut(guest)

    def close(self) -> None:
        """Cut everybody."""
        for guest in list(self._guests.values()):
            self._cut(guest)

    async def run(self) -> None:
        """Sweep for ever."""
        while True:
            await asyncio.sleep(SWEEP_S)
            self.sweep()

    def _stalled(self, guest: Guest, now_s: float) -> bool:
        if not (guest.full or guest.transport.is_closing()):
            guest.backlog_bytes = 0
            return False
        size = guest.transport.get_write_buffer_size()  # nothing is put in now: what it loses was taken
        if not guest.backlog_bytes or size <= guest.backlog_bytes - LEAST_TAKEN_BYTES:
            guest.backlog_bytes, guest.backlog_s = max(1, size), now_s
        return now_s - guest.backlog_s >= self.limits.answer_stall_s

    def _evict(self, waiting: dict[Guest, None]) -> bool:
        guest = next(iter(waiting), None)
        if guest is None:
            return False
        self._cut(guest)
        return True

    def _cut(self, guest: Guest) -> None:
        self.leave(guest)
        guest.transport.abort()


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
