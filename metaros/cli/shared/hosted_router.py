"""A Zenoh router for as long as a command runs, where none is there."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

__all__ = ["hosted_router"]


@contextmanager
def hosted_router(port: int, command: str) -> Iterator[bool]:
    """Our own router on `port`, unless one is there; whether it is ours. ConfigError where another program has it."""
    from metaros.cli.shared.ports import port_owner
    from metaros.errors import ConfigError
    from metaros.wire.router import open_router, probe

    state = probe(port)
    if state == "foreign":
        raise ConfigError(
            f"port {port} is in use by {port_owner(port)}\nchoose another: metaros {command} --zenoh-port PORT"
        )
    if state == "zenoh":
        yield False
    else:
        with open_router(port):
            yield True
