"""Listening sockets: a port that was asked for is had or is an error with its owner; a default one may move."""

from __future__ import annotations

import importlib
import socket
import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass

from metaros.errors import ConfigError

__all__ = ["NO_PORT", "Listeners", "PortChoice", "listen", "listen_all", "owner_of", "port_of"]

NO_PORT = -1  # not to be had at all
Listeners = Sequence[socket.socket | None]


@dataclass(frozen=True, slots=True)
class PortChoice:
    """A port as somebody chose it: None the default or a free one, 0 a free one, NO_PORT none."""

    port: int | None
    default: int
    flag: str


@contextmanager
def listen_all(host: str, choices: Sequence[PortChoice]) -> Iterator[Listeners]:
    """All of them bound, or none; closed at the end. Those that nobody wants are None."""
    with ExitStack() as stack:
        yield [
            None
            if choice.port == NO_PORT
            else stack.enter_context(listen(host, choice.port, default=choice.default, flag=choice.flag))
            for choice in choices
        ]


def port_of(listener: socket.socket | None) -> int:
    """The port that a socket is bound to; 0 where there is none."""
    return int(listener.getsockname()[1]) if listener is not None else 0


def listen(host: str, port: int | None, *, default: int, flag: str) -> socket.socket:
    """A bound TCP socket. `port` None: `default`, or a free one where that is taken; 0: a free one."""
    try:
        return _bind(host, default if port is None else port)
    except OSError as error:
        if port is None:
            return _bind(host, 0)
        owner = owner_of(port)
        raise ConfigError(
            f"port {port} cannot be opened: {owner or error.strerror}\nChoose another with {flag}, or leave {flag} out."
        ) from error


def owner_of(port: int) -> str:
    """Who listens on a local port, as far as the system tells; "" when it does not."""
    try:
        psutil = importlib.import_module("psutil")
    except ImportError:
        return ""
    try:
        for item in psutil.net_connections("tcp"):
            if item.status == psutil.CONN_LISTEN and item.laddr.port == port and item.pid is not None:
                return f"{psutil.Process(item.pid).name()} (pid {item.pid}) has it"
    except psutil.Error:
        return ""
    return ""


def _bind(host: str, port: int) -> socket.socket:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    listener = socket.socket(family, socket.SOCK_STREAM)
    try:
        if sys.platform == "win32":  # there SO_REUSEADDR would share the port with who has it
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_EXCLUSIVEADDRUSE, 1)
        else:
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        listener.bind((host, port))
        listener.listen(1024)
    except OSError:
        listener.close()
        raise
    listener.setblocking(False)
    return listener
