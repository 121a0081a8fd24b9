"""The supervisor's control protocol: lines of JSON, a request and its answer each.

`{"id": 7, "verb": "restart", "node": "lidar"}` is answered by `{"id": 7, "ok": true, …}` or `{"id": 7, "ok": false,
"code": …, "message": …}`, in the order in which they are done. A line, the clients and what each asks at a time are
bounded; who breaks the protocol gets an error and is disconnected, and nobody else notices.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import socket
import sys
from collections.abc import Awaitable, Callable
from typing import Any, Final

from metaros.errors import ConfigError, MetarosError
from metaros.limits import LIMITS
from metaros.supervise.control_socket import LINE_BYTES, ControlSocket

__all__ = ["CLIENTS", "Control", "Handler"]

LOG = logging.getLogger("metaros.supervisor")
CLIENTS: Final = LIMITS.supervisor_clients
AT_ONCE: Final = LIMITS.supervisor_requests  # requests of one client
_STALL_S: Final = 10.0  # a client that takes no answer for so long is put out
Request = dict[str, Any]
Handler = Callable[[str, Request], Awaitable[dict[str, Any]]]


class Control:
    """Serves `handle(verb, request)` to authorized clients."""

    def __init__(self, control_socket: ControlSocket, handle: Handler) -> None:
        self._control_socket = control_socket
        self._handle = handle
        self._server: asyncio.Server | None = None
        self._clients: set[asyncio.Task[None]] = set()

    async def open(self) -> None:
        """Listen. Raises OSError."""
        found = self._control_socket.listen()
        if sys.platform != "win32" and found.family == socket.AF_UNIX:
            self._server = await asyncio.start_unix_server(self._came, sock=found, limit=LINE_BYTES)
        else:
            self._server = await asyncio.start_server(self._came, sock=found, limit=LINE_BYTES)

    async def close(self) -> None:
        """Listen no more, and end what is under way."""
        if self._server is not None:
            self._server.close()
        for task in self._clients:
            task.cancel()
        await asyncio.gather(*self._clients, return_exceptions=True)
        self._control_socket.close()

    async def _came(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None
        self._clients.add(task)
        try:
            if len(self._clients) > CLIENTS:
                await _write(writer, _refusal(None, "busy", f"{CLIENTS} clients are here"))
            elif not await self._control_socket.authorizes(reader, writer):
                await _write(writer, _refusal(None, "forbidden", "this supervisor is another user's"))
            else:
                await _Client(reader, writer, self._handle).run()
        except (OSError, TimeoutError):
            pass
        finally:
            self._clients.discard(task)
            writer.close()


class _Client:
    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, handle: Handler) -> None:
        self._reader, self._writer, self._handle = reader, writer, handle
        self._room = asyncio.Semaphore(AT_ONCE)
        self._tasks: set[asyncio.Task[None]] = set()

    async def run(self) -> None:
        """Until the client goes, or breaks the protocol."""
        try:
            while True:
                await self._room.acquire()
                try:
                    line = await self._reader.readuntil(b"\n")
                except asyncio.IncompleteReadError:
                    break
                except asyncio.LimitOverrunError:
                    await _write(self._writer, _refusal(None, "too_large", f"a line has at most {LINE_BYTES} bytes"))
                    return
                task = asyncio.create_task(self._answer(line))
                self._tasks.add(task)
                task.add_done_callback(self._done)
        finally:
            for task in self._tasks:
                task.cancel()
            await asyncio.gather(*self._tasks, return_exceptions=True)

    def _done(self, task: asyncio.Task[None]) -> None:
        self._tasks.discard(task)
        self._room.release()
        if not task.cancelled() and task.exception() is not None:
            self._writer.close()

    async def _answer(self, line: bytes) -> None:
        number: object = None
        try:
            request = _request(line)
            number = request.get("id")
            answer = {"id": number, "ok": True, **await self._handle(request["verb"], request)}
        except MetarosError as error:
            answer = _refusal(number, error.code, str(error))
        except OSError as error:
            answer = _refusal(number, "disk_error", str(error))
        except Exception as error:
            LOG.exception("a request failed")
            answer = _refusal(number, "internal", f"{type(error).__name__}: {error}")
        await _write(self._writer, answer)


def _request(line: bytes) -> Request:
    try:
        found = json.loads(line)
    except (ValueError, RecursionError):
        raise ConfigError("expected a line of JSON") from None
    if not isinstance(found, dict) or not isinstance(found.get("verb"), str):
        raise ConfigError("expected an object with a verb")
    number = found.get("id")
    if not (number is None or isinstance(number, int | float) or (isinstance(number, str) and len(number) <= 64)):
        raise ConfigError("id: a number or a short text")
    return found


def _refusal(number: object, code: str, message: str) -> dict[str, Any]:
    return {"id": number, "ok": False, "code": code, "message": message[:1000]}


async def _write(writer: asyncio.StreamWriter, answer: dict[str, Any]) -> None:
    with contextlib.suppress(ConnectionError):
        writer.write(json.dumps(answer).encode(errors="replace") + b"\n")
        await asyncio.wait_for(writer.drain(), _STALL_S)
