"""Which TCP ports an instance takes: a default one in use moves to a free one, an explicit one in use is an error."""

from __future__ import annotations

import errno
import socket
import sys
from collections.abc import Iterable
from dataclasses import dataclass

from metaros.errors import ConfigError

__all__ = ["PortChoice", "choose_port", "port_accepts", "port_free", "port_owner"]


@dataclass(frozen=True, slots=True)
class PortChoice:
    """The port taken, and what was in the way of the wanted one."""

    port: int
    wanted: int
    owner: str = ""

    @property
    def moved(self) -> bool:
        """True where the default was not to be had."""
        return self.port != self.wanted


def port_free(port: int, *, host: str = "127.0.0.1") -> bool:
    """True where a server could listen now."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family) as probe:
        if sys.platform != "win32":  # where it means something else: share the port with who has it
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # connections in TIME_WAIT do not count
        try:
            probe.bind((host, port))
            probe.listen(1)
        except PermissionError as error:
            raise ConfigError(f"port {port} on {host} is not allowed: {error.strerror}") from error
        except OSError as error:
            if error.errno == errno.EADDRINUSE:
                return False
            raise ConfigError(f"cannot listen on {host}: {error.strerror}") from error
    return True


def port_accepts(port: int, *, host: str = "127.0.0.1", timeout_s: float = 0.5) -> bool:
    """True where somebody takes connections."""
    try:
        socket.create_connection((host, port), timeout_s).close()
    except OSError:
        return False
    return True


def port_owner(port: int) -> str:
    """The program that listens, as `python3 (pid 123)`; "another program" where the system does not tell."""
    try:
        import psutil
    except ImportError:
        return "another program"
    try:
        for connection in psutil.net_connections(kind="tcp"):
            if connection.status == psutil.CONN_LISTEN and connection.laddr[1:] == (port,) and connection.pid:
                return f"{psutil.Process(connection.pid).name()} (pid {connection.pid})"
    except (psutil.Error, OSError):
        pass
    return "another program"


def choose_port(
    what: str,
    explicit: int | None,
    default: int,
    *,
    host: str = "127.0.0.1",
    taken: Iterable[int] = (),
    avoid: Iterable[int] = (),
) -> PortChoice:
    """`explicit` or nothing; else `default`, or the next free one above it.

    `taken` are claimed by other instances; `avoid` are left to other services when this one has to move.
    """
    claimed, left_alone = set(taken), set(avoid)
    wanted = default if explicit is None else explicit
    if wanted not in claimed and port_free(wanted, host=host):
        return PortChoice(wanted, wanted)
    owner = port_owner(wanted) if wanted not in claimed else "another `metaros up`"
    if explicit is not None:
        raise ConfigError(f"port {wanted} ({what}) is in use by {owner}")
    for port in range(default + 1, default + 200):
        if port not in claimed | left_alone and port_free(port, host=host):
            return PortChoice(port, wanted, owner)
    raise ConfigError(f"no free port for {what} between {default} and {default + 199}")
