"""Heartbeats: a node says on its own executor thread that it lives, so that a stuck loop is seen.

`HeartbeatMonitor` is the pure part: words and times in, verdict out. `HeartbeatPort` receives from all processes of a
supervisor on one UDP socket of this host; each process has a token, which stops mistakes, but
nobody who may read its environment.
A process is checked from its first heartbeat on: one that starts slowly, or is no node of ours, is left alone.
"""

from __future__ import annotations

import asyncio
import secrets
from collections.abc import Callable

__all__ = ["ENVIRONMENT", "MISSED", "HeartbeatMonitor", "HeartbeatPort"]

ENVIRONMENT = "METAROS_HEARTBEAT"  # host:port:token:period_s
MISSED = 3
_NODES = 256  # in one process


class HeartbeatMonitor:
    """The heartbeats of one process: each of its nodes that spins has a number and speaks every `period_s`."""

    def __init__(self, period_s: float) -> None:
        self.period_s = period_s
        self._last: dict[str, float] = {}

    def beat(self, word: str, now: float) -> None:
        """`+3`: its third node lives; `-3`: that node has stopped spinning in good order."""
        sign, number = word[:1], word[1:]
        if sign == "-":
            self._last.pop(number, None)
        elif sign == "+" and (number in self._last or len(self._last) < _NODES):
            self._last[number] = now

    @property
    def beating(self) -> bool:
        """Whether any node is being watched."""
        return bool(self._last)

    def silence_s(self, now: float) -> float:
        """How long the most silent of its nodes has not been heard."""
        return max((now - last for last in self._last.values()), default=0.0)

    def hung(self, now: float) -> bool:
        """Whether a node has missed its beats."""
        return self.silence_s(now) > MISSED * self.period_s


class HeartbeatPort(asyncio.DatagramProtocol):
    """Where heartbeats arrive. `open` once on the event loop; `register` each process before it starts."""

    def __init__(self, now: Callable[[], float]) -> None:
        self._now = now
        self._pulses: dict[str, HeartbeatMonitor] = {}
        self._transport: asyncio.BaseTransport | None = None
        self._address = ("", 0)

    async def open(self) -> None:
        """Listen on a free port of the loopback."""
        if self._transport is None:
            loop = asyncio.get_running_loop()
            self._transport, _ = await loop.create_datagram_endpoint(lambda: self, local_addr=("127.0.0.1", 0))
            self._address = self._transport.get_extra_info("sockname")[:2]

    def close(self) -> None:
        """Listen no more."""
        if self._transport is not None:
            self._transport.close()
            self._transport = None

    def register(self, pulse: HeartbeatMonitor) -> tuple[str, str]:
        """A token for a process that is about to start, and what its environment says."""
        token = secrets.token_hex(8)
        self._pulses[token] = pulse
        host, port = self._address
        return token, f"{host}:{port}:{token}:{pulse.period_s:g}"

    def forget(self, token: str) -> None:
        """The process is gone."""
        self._pulses.pop(token, None)

    def datagram_received(self, data: bytes, addr: object) -> None:
        """`token word`; anything else is not for us."""
        token, _, word = data[:64].decode("ascii", "replace").partition(" ")
        pulse = self._pulses.get(token)
        if pulse is not None:
            pulse.beat(word, self._now())

    def error_received(self, error: Exception) -> None:
        """A socket error of a sender that has gone."""
