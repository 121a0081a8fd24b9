"""The way out of a worker: a proxy that listens inside its network and connects to what its patterns allow.

The proxy looks names up itself and connects to the address that it looked at: what a name leads to later is of no
use. It sees where a connection goes, and nothing of what goes over it with TLS.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import socket
from collections.abc import Awaitable, Callable, Sequence
from concurrent.futures import ThreadPoolExecutor

from metaros.automation.functions.egress import http
from metaros.automation.functions.egress.http import EgressRefusedError, Target
from metaros.automation.functions.egress.rules import EGRESS, EgressRules, address_of
from metaros.limits import LIMITS, Limits

__all__ = ["Egress", "EgressProxy", "Resolve"]

log = logging.getLogger(__name__)

READ_BYTES = 65_536
LOOKUPS_EACH = 2  # of one worker: a name server that hangs is not the others' trouble
Resolve = Callable[[str, int], Awaitable[Sequence[str]]]
Streams = tuple[asyncio.StreamReader, asyncio.StreamWriter]


class Egress:
    """What the proxies of all workers share. `bound` is what the operator allows beyond what a function asks for; None:
    all of that. `resolve` looks a name up.
    """

    def __init__(
        self, *, bound: EgressRules | None = None, resolve: Resolve | None = None, limits: Limits = LIMITS
    ) -> None:
        self.bound, self.limits = bound, limits
        self.resolve = resolve or self._look_up
        self.connections = 0
        self._threads = ThreadPoolExecutor(limits.function_egress_lookups, thread_name_prefix="function-egress")

    def close(self) -> None:
        """Look nothing up any more; the proxies are ended by whoever has them."""
        self._threads.shutdown(wait=False, cancel_futures=True)

    def proxy(self, rules: EgressRules, note: Callable[[str], None]) -> EgressProxy:
        """One worker's; `note` gets a line for what was refused."""
        return EgressProxy(self, rules, note=note)

    async def _look_up(self, host: str, port: int) -> Sequence[str]:
        def ask() -> list[str]:
            found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
            return list(dict.fromkeys(str(item[4][0]) for item in found))

        return await asyncio.get_running_loop().run_in_executor(self._threads, ask)


class EgressProxy:
    """The proxy of one worker, from `start` to `close`."""

    def __init__(self, egress: Egress, rules: EgressRules, *, note: Callable[[str], None]) -> None:
        self._egress, self._rules, self._note = egress, rules, note
        self._limits = egress.limits
        self._lookups = asyncio.Semaphore(LOOKUPS_EACH)
        self._tasks: set[asyncio.Task[None]] = set()
        self._server: asyncio.Server | None = None
        self._closed = False

    async def start(self, listener: socket.socket) -> None:
        """Serve on `listener`, which is the proxy's from now on."""
        most_bytes = self._limits.function_egress_buffer_bytes // 2  # a reader holds twice its limit
        self._server = await asyncio.start_server(self._begin, sock=listener, limit=most_bytes)

    async def close(self) -> None:
        """Take no more, and break off what is under way."""
        self._closed = True
        if self._server is not None:
            self._server.close()
        tasks = list(self._tasks)
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    def _begin(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        limits, egress = self._limits, self._egress
        # Who asks for too many is told so, but not so many either.
        over = len(self._tasks) >= 2 * limits.function_egress_connections
        if self._closed or over or egress.connections >= 2 * limits.function_egress_all:
            writer.transport.abort()
            return
        task = asyncio.get_running_loop().create_task(self._serve(reader, writer), name="function-egress")
        self._tasks.add(task)
        egress.connections += 1
        task.add_done_callback(self._ended)

    def _ended(self, task: asyncio.Task[None]) -> None:
        self._tasks.discard(task)
        self._egress.connections -= 1
        if not task.cancelled() and (error := task.exception()) is not None:
            log.error("a function's connection broke off", exc_info=error)

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """One connection of the worker, which is one request or tunnel."""
        try:
            await self._relay(reader, writer)
        except EgressRefusedError as refused:
            self._note(str(refused))
            writer.write(http.refusal(refused))
        except (OSError, asyncio.IncompleteReadError):
            pass  # either end is gone, or was silent for too long: the other one learns it by the close
        finally:
            await self._end(writer)

    async def _relay(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        limits = self._limits
        async with asyncio.timeout(limits.function_egress_connect_s):
            lines = await http.head(reader, limits.function_egress_head_bytes)
        target = http.target_of(lines)
        self._check_room()
        theirs = await self._connect(target)
        try:
            async with asyncio.timeout(limits.function_egress_idle_s) as idle:
                await self._carry(target, (reader, writer), theirs, self._awake(idle))
        finally:
            await self._end(theirs[1])

    async def _end(self, writer: asyncio.StreamWriter) -> None:
        """Close it when it has sent what it holds; who does not take that in time is broken off."""
        writer.close()
        if not self._closed:
            with contextlib.suppress(OSError):
                async with asyncio.timeout(self._limits.function_egress_connect_s):
                    await writer.wait_closed()
        writer.transport.abort()

    def _check_room(self) -> None:
        limits = self._limits
        if len(self._tasks) > limits.function_egress_connections:
            raise EgressRefusedError(503, f"more than {limits.function_egress_connections} connections at a time")
        if self._egress.connections > limits.function_egress_all:
            raise EgressRefusedError(503, f"all functions have {limits.function_egress_all} connections already")

    async def _connect(self, target: Target) -> Streams:
        """A connection to an address that was looked at; EgressRefusedError."""
        within_s = self._limits.function_egress_connect_s
        try:
            async with asyncio.timeout(within_s):
                return await self._open(await self._addresses(target), target)
        except TimeoutError:
            raise EgressRefusedError(504, f"{target}: no connection within {within_s:g} s") from None

    async def _addresses(self, target: Target) -> Sequence[str]:
        host, port = target.host, target.port
        own = self._rules.check(host, port)
        if own is None:
            raise EgressRefusedError(403, f"{target}: {EGRESS} does not allow it")
        bound = self._egress.bound
        allowed = bound.check(host, port) if bound is not None else own
        if allowed is None:
            raise EgressRefusedError(403, f"{target}: this gateway allows it to no function (--function-egress)")
        found = [host] if address_of(host) is not None else await self._looked_up(target)
        for address in found:
            if not (own(address) and allowed(address)):
                named = "an address" if address == host else address
                raise EgressRefusedError(403, f"{target} is {named} that is not public, and not allowed as such")
        return found

    async def _looked_up(self, target: Target) -> Sequence[str]:
        try:
            async with self._lookups:
                return await self._egress.resolve(target.host, target.port)
        except TimeoutError:
            raise
        except (OSError, UnicodeError, RuntimeError) as error:
            raise EgressRefusedError(502, f"{target}: the name cannot be looked up: {error}") from None

    async def _open(self, addresses: Sequence[str], target: Target) -> Streams:
        """The first that answers; each has its share of the time."""
        share_s = self._limits.function_egress_connect_s / max(2, len(addresses))
        most_bytes = self._limits.function_egress_buffer_bytes // 2
        errors: list[str] = []
        for address in addresses:
            try:
                async with asyncio.timeout(share_s):
                    return await asyncio.open_connection(address, target.port, limit=most_bytes)
            except OSError as error:  # TimeoutError is one
                errors.append(f"{address}: {error.strerror or 'no answer'}")
        raise EgressRefusedError(502, f"{target}: {'; '.join(errors[:4]) or 'the name has no address'}")

    def _awake(self, idle: asyncio.Timeout) -> Callable[[], None]:
        """What is told whenever something goes over the connection."""
        loop, for_s = asyncio.get_running_loop(), self._limits.function_egress_idle_s
        return lambda: idle.reschedule(loop.time() + for_s)

    async def _carry(self, target: Target, ours: Streams, theirs: Streams, awake: Callable[[], None]) -> None:
        """Both ways until the far end has said all, or either is gone."""
        (reader, writer), (their_reader, their_writer) = ours, theirs
        if target.tunnel:
            writer.write(b"HTTP/1.1 200 Connection established\r\n\r\n")
            ways = [_copy(reader, their_writer, awake), _copy(their_reader, writer, awake)]
        else:
            their_writer.write(target.request)
            sending = http.send_body(target, reader, their_writer, awake)
            ways = [sending, self._answer(their_reader, writer, awake)]
        there, back = (asyncio.ensure_future(way) for way in ways)
        try:
            await asyncio.wait((there, back), return_when=asyncio.FIRST_COMPLETED)
            if there.done():
                there.result()
            await back
        finally:
            there.cancel()
            back.cancel()
            await asyncio.gather(there, back, return_exceptions=True)

    async def _answer(
        self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, awake: Callable[[], None]
    ) -> None:
        writer.write(await http.answer_head(reader, writer, self._limits.function_egress_head_bytes))
        await _copy(reader, writer, awake)


async def _copy(reader: asyncio.StreamReader, writer: asyncio.StreamWriter, awake: Callable[[], None]) -> None:
    """One way, as fast as its receiver takes it, with its end."""
    while data := await reader.read(READ_BYTES):
        writer.write(data)
        await writer.drain()
        awake()
    if writer.can_write_eof():
        writer.write_eof()
