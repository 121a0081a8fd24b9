"""The supervisor's control socket: a Unix socket for its user alone; on Windows loopback TCP with a token in a file.

Everything that may come in here may run programs as this user. So nobody else gets in, whatever a file's mode says: the
kernel is asked who is at the other end.
"""

from __future__ import annotations

import asyncio
import contextlib
import hmac
import json
import os
import secrets
import socket
import struct
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from metaros.errors import UnavailableError
from metaros.limits import LIMITS
from metaros.supervise.node_table_file import write_whole

__all__ = ["LINE_BYTES", "SOCKET", "TOKEN", "ControlSocket", "connect"]

SOCKET: Final = "supervisor.sock"
TOKEN: Final = "supervisor.token"
LINE_BYTES: Final = LIMITS.node_table_bytes  # one request or answer
_PATH_BYTES: Final = 100  # a socket's path has at most 108 on Linux, 104 on macOS
_TOKEN_S: Final = 5.0
Streams = tuple[asyncio.StreamReader, asyncio.StreamWriter]


def has_unix() -> bool:
    """Whether this platform's loop has Unix sockets."""
    return sys.platform != "win32"


class ControlSocket:
    """One directory's control socket; `listen` under the directory's lock."""

    def __init__(self, directory: Path, *, unix: bool | None = None) -> None:
        self._directory = directory
        self._unix = has_unix() if unix is None else unix
        self._token = ""

    def listen(self) -> socket.socket:
        """The listening socket, in the place of one that a dead supervisor left."""
        self.close()
        return self._listen_unix() if self._unix else self._listen_tcp()

    def close(self) -> None:
        """Remove the socket."""
        for name in (SOCKET, TOKEN):
            with contextlib.suppress(OSError):
                (self._directory / name).unlink(missing_ok=True)

    async def authorizes(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> bool:
        """Whether the client is this user."""
        if self._unix:
            return is_ours(writer.get_extra_info("socket"))
        try:
            line = await asyncio.wait_for(reader.readline(), _TOKEN_S)
            token = json.loads(line)["token"]
            return isinstance(token, str) and hmac.compare_digest(token.encode(), self._token.encode())
        except (TimeoutError, ValueError, KeyError, TypeError, OSError):
            return False

    def _listen_unix(self) -> socket.socket:
        if sys.platform == "win32":
            raise OSError("this platform has no Unix sockets that its loop knows")
        else:
            path = self._directory / SOCKET
            found = socket.socket(socket.AF_UNIX)
            try:
                with reachable(path) as short:
                    found.bind(short)
                path.chmod(0o600)
                found.listen(16)
            except OSError:
                found.close()
                raise
            return found

    def _listen_tcp(self) -> socket.socket:
        found = socket.create_server(("127.0.0.1", 0))
        self._token = secrets.token_urlsafe(32)
        facts = {"port": found.getsockname()[1], "token": self._token}
        write_whole(self._directory / TOKEN, json.dumps(facts).encode())
        return found


async def connect(directory: Path) -> Streams:
    """Streams to the supervisor of a state directory. Raises UnavailableError where none runs."""
    try:
        if sys.platform == "win32" or (directory / TOKEN).exists():
            return await _connect_tcp(directory / TOKEN)
        else:
            with reachable(directory / SOCKET) as short:
                return await asyncio.open_unix_connection(short, limit=2 * LINE_BYTES)
    except (OSError, ValueError, KeyError, AttributeError) as error:
        raise UnavailableError(f"no supervisor runs in {directory}: {error}") from None


async def _connect_tcp(path: Path) -> Streams:
    facts = json.loads(path.read_bytes())  # noqa: ASYNC240  (a few bytes, and not of a network)
    reader, writer = await asyncio.open_connection("127.0.0.1", int(facts["port"]), limit=2 * LINE_BYTES)
    writer.write(json.dumps({"token": facts["token"]}).encode() + b"\n")
    return reader, writer


def is_ours(connection: socket.socket) -> bool:
    """Whether this user is at the other end of a Unix socket."""
    if sys.platform == "win32":
        return False
    else:
        return peer_uid(connection) == os.getuid()


def peer_uid(connection: socket.socket) -> int:
    """Who is at the other end of a Unix socket; -1 where the platform does not say."""
    if sys.platform == "linux":
        _, uid, _ = struct.unpack("3i", connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, 12))
        return int(uid)
    elif sys.platform == "darwin":
        _, uid = struct.unpack("Ii", connection.getsockopt(0, 1, 76)[:8])  # LOCAL_PEERCRED
        return int(uid)
    else:
        return -1


@contextmanager
def reachable(path: Path) -> Iterator[str]:
    """A text for the socket's path that the system takes: a long one goes by a descriptor of its directory."""
    if sys.platform == "linux" and len(os.fsencode(path)) > _PATH_BYTES:
        folder = os.open(path.parent, os.O_PATH | os.O_DIRECTORY)
        try:
            yield f"/proc/self/fd/{folder}/{path.name}"
        finally:
            os.close(folder)
    else:
        yield str(path)
