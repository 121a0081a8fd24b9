"""Client of a supervisor's control protocol: numbered requests, answers as they come."""

from __future__ import annotations

import asyncio
import contextlib
import json
from pathlib import Path
from types import TracebackType
from typing import Any, Final

from metaros.errors import ConfigError, FrameError, MetarosError, PeerError, TimeoutError_, UnavailableError
from metaros.supervise.control_socket import LINE_BYTES, connect

__all__ = ["ANSWER_S", "SupervisorClient", "ask"]

ANSWER_S: Final = 30.0
_CAUSES: Final[dict[str, type[MetarosError]]] = {"invalid_config": ConfigError, "unavailable": UnavailableError}


class SupervisorClient:
    """A connection. `async with await SupervisorClient.open(directory) as client: await client.ask("list")`."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._reader, self._writer = reader, writer
        self._number = 0
        self._waiting: dict[int, asyncio.Future[dict[str, Any]]] = {}
        self._reading = asyncio.create_task(self._read())

    @classmethod
    async def open(cls, directory: Path) -> SupervisorClient:
        """Connect to the supervisor of a state directory. Raises UnavailableError."""
        return cls(*await connect(directory))

    @property
    def closed(self) -> bool:
        """Whether nothing can be asked any more."""
        return self._reading.done()

    async def ask(self, verb: str, *, timeout_s: float = ANSWER_S, **request: Any) -> dict[str, Any]:
        """One request.

        Raises:
            UnavailableError: no such node, or the supervisor went away.
            ConfigError: it does not take the request.
            TimeoutError_: no answer in time; it may still be done.
            PeerError: any other refusal.
        """
        self._number += 1
        number = self._number
        line = json.dumps({**request, "id": number, "verb": verb}).encode() + b"\n"
        if len(line) > LINE_BYTES:
            raise ConfigError(f"{verb}: a request has at most {LINE_BYTES} bytes")
        if self.closed:
            raise UnavailableError("the supervisor is gone")
        answer: asyncio.Future[dict[str, Any]] = asyncio.get_running_loop().create_future()
        self._waiting[number] = answer
        try:
            async with asyncio.timeout(timeout_s):  # wait_for of Python 3.11 may swallow a cancellation
                self._writer.write(line)
                await self._writer.drain()
                found = await answer
        except TimeoutError:
            raise TimeoutError_(f"the supervisor did not answer {verb} within {timeout_s:g} s") from None
        except OSError as error:
            raise UnavailableError(f"the supervisor is gone: {error}") from None
        finally:
            self._waiting.pop(number, None)
            if answer.done() and not answer.cancelled():
                answer.exception()  # seen, also where we were cancelled meanwhile
        if not found.get("ok"):
            raise _CAUSES.get(str(found.get("code")), PeerError)(str(found.get("message")))
        return found

    async def close(self) -> None:
        """Hang up."""
        self._reading.cancel()
        self._writer.close()
        with contextlib.suppress(OSError, asyncio.CancelledError):
            await self._reading
        with contextlib.suppress(OSError):
            await self._writer.wait_closed()

    async def __aenter__(self) -> SupervisorClient:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.close()

    async def _read(self) -> None:
        why: MetarosError = UnavailableError("the supervisor is gone")
        try:
            while line := await self._reader.readline():
                found = json.loads(line)
                number = found.get("id") if isinstance(found, dict) else None
                if number is None:
                    why = FrameError(f"the supervisor said: {str(found)[:200]}")
                elif (waiting := self._waiting.get(number)) is not None and not waiting.done():
                    waiting.set_result(found)
        except (OSError, ValueError):
            pass
        finally:
            for waiting in self._waiting.values():
                if not waiting.done():
                    waiting.set_exception(why)
            self._writer.close()


def ask(directory: Path, verb: str, *, timeout_s: float = ANSWER_S, **request: Any) -> dict[str, Any]:
    """The same for a program without an event loop: one request over a connection of its own."""

    async def once() -> dict[str, Any]:
        async with await SupervisorClient.open(directory) as client:
            return await client.ask(verb, timeout_s=timeout_s, **request)

    return asyncio.run(once())
