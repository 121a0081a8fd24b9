"""Heartbeats of a supervised process: each node sends them from its executor's thread.

A thread of the process asks every node in turn, through its executor, to speak; an executor that is stuck in a
callback cannot. Only a supervisor that listens, by what it wrote into the environment, makes any of this happen.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final

from metaros.executor import Mailbox, Spinnable

if TYPE_CHECKING:
    from socket import socket

__all__ = ["ENVIRONMENT", "follow", "leave"]

ENVIRONMENT: Final = "METAROS_HEARTBEAT"  # host:port:token:period_s, by the supervisor
_lock = threading.Lock()
_sender: _Sender | None = None


def follow(node: Spinnable) -> None:
    """Let the supervisor know from now on that the node's executor works; nothing without a supervisor."""
    sender = _of_process()
    if sender is not None:
        sender.add(node)


def leave(node: Spinnable) -> None:
    """The node is closed, or no longer spun: its silence means nothing."""
    sender = _sender
    if sender is not None:
        sender.discard(node)


def _of_process() -> _Sender | None:
    global _sender
    with _lock:
        where = os.environ.pop(ENVIRONMENT, "")  # it is meant for this process, not for those that it starts
        if where and _sender is None:
            _sender = _Sender(where)
        return _sender


class _Sender:
    """The thread that asks, and the socket to the supervisor."""

    def __init__(self, where: str) -> None:
        host, port, self._token, period = where.rsplit(":", 3)
        self._address, self._period_s = (host, int(port)), float(period)
        self._socket: socket | None = None
        self._numbers = 0
        self._nodes: dict[Spinnable, tuple[int, Callable[[Any], None]]] = {}
        self._spoken: set[Spinnable] = set()
        self._lock = threading.Lock()
        self._new = threading.Event()
        threading.Thread(target=self._run, name="metaros-heartbeat", daemon=True).start()

    def add(self, node: Spinnable) -> None:
        """Ask this node, too."""
        with self._lock:
            if node in self._nodes:
                return
            self._numbers += 1
            number = self._numbers
            mailbox = Mailbox(
                lambda item: self._speak(node, f"+{number}"),
                owner=node,
                depth=1,
                limit_bytes=1024,
                size_of=lambda item: 1,
            )
            self._nodes[node] = number, node.ingress.put_to(mailbox)
        self._new.set()

    def discard(self, node: Spinnable) -> None:
        """Ask it no more, and say that it left in good order."""
        with self._lock:
            found = self._nodes.pop(node, None)
            spoke = node in self._spoken
            self._spoken.discard(node)
        if found is not None and spoke:
            self._send(f"-{found[0]}")

    def _run(self) -> None:
        while True:
            self._new.wait(self._period_s)
            self._new.clear()
            with self._lock:
                nodes = list(self._nodes.items())
            for _, (_, ask) in nodes:
                ask(None)

    def _speak(self, node: Spinnable, word: str) -> None:
        with self._lock:
            if node not in self._nodes:
                return
            self._spoken.add(node)
        self._send(word)

    def _send(self, word: str) -> None:
        if self._socket is None:
            import socket  # not while the node starts

            self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            self._socket.setblocking(False)
        try:
            self._socket.sendto(f"{self._token} {word}".encode(), self._address)
        except OSError:  # a full buffer, or no supervisor any more
            return
