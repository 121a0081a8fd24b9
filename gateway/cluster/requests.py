"""Requests between gateways: those that wait for a response, and those that are being served."""

from __future__ import annotations

import asyncio
import itertools
import logging
from collections.abc import Callable
from typing import Final

from gateway.cluster.errors import PeerBusyError, PeerGoneError, PeerRefusedError, pack_error, unpack_error
from gateway.cluster.ports import Answer
from gateway.cluster.wire import MESSAGE_BYTES, Kind, Message
from metaros.errors import MetarosError, TooLargeError
from metaros.limits import LIMITS

__all__ = ["PendingRequests", "RequestServer"]

log = logging.getLogger(__name__)

LONGEST_S: Final = 960.0  # a question's time bound: a function may run for 15 minutes, and must start first


class PendingRequests:
    """Requests sent by this gateway, by number; each waits for one process of another gateway."""

    def __init__(self, most: int = LIMITS.cluster_asks) -> None:
        self._most = most
        self._numbers = itertools.count(1)
        self._waiting: dict[int, tuple[bytes, asyncio.Future[bytes]]] = {}

    def __len__(self) -> int:
        return len(self._waiting)

    def open(self, boot: bytes) -> tuple[int, asyncio.Future[bytes]]:
        """A new request's number, and the future of its response; PeerBusyError when too many wait."""
        if len(self._waiting) >= self._most:
            raise PeerBusyError(f"{self._most} questions wait for other replicas' answers already: try again")
        number, answer = next(self._numbers), asyncio.get_running_loop().create_future()
        self._waiting[number] = (boot, answer)
        return number, answer

    def drop(self, number: int) -> None:
        """Nobody waits for it any more."""
        self._waiting.pop(number, None)

    def settle(self, boot: bytes, message: Message) -> None:
        """An answer or a refusal has come; one that nobody waits for is put aside."""
        asked, answer = self._waiting.get(message.number, (b"", None))
        if answer is None or asked != boot or answer.done():
            return
        if message.kind is Kind.ANSWER:
            answer.set_result(message.payload)
            return
        try:
            answer.set_exception(unpack_error(message.payload))
        except (ValueError, KeyError, TypeError):
            answer.set_exception(PeerRefusedError("internal", "the other replica's refusal cannot be read"))

    def gone(self, boot: bytes, gateway: str) -> None:
        """The process that was to answer is lost."""
        for asked, answer in list(self._waiting.values()):
            if asked == boot and not answer.done():
                answer.set_exception(PeerGoneError(f"the replica {gateway} went before it answered"))


class RequestServer:
    """Serves requests of other gateways, each in a task of its own, within the caller's timeout."""

    def __init__(self, most: int = LIMITS.cluster_asks) -> None:
        self._most = most
        self._verbs: dict[str, Answer] = {}
        self._tasks: set[asyncio.Task[None]] = set()

    def on_request(self, verb: str, answer: Answer) -> None:
        """Who answers a verb."""
        self._verbs[verb] = answer

    def begin(self, gateway: str, asked: Message, reply: Callable[[Kind, bytes], None]) -> None:
        """Serve a request; `reply` is given its response or error."""
        if len(self._tasks) >= self._most:
            reply(Kind.REFUSAL, pack_error(PeerBusyError("the other replica has too many questions: try again")))
            return
        task = asyncio.get_running_loop().create_task(self._answer(gateway, asked, reply))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def close(self) -> None:
        """End what is under way."""
        for task in list(self._tasks):
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    async def _answer(self, gateway: str, asked: Message, reply: Callable[[Kind, bytes], None]) -> None:
        try:
            answer = self._verbs.get(asked.name)
            if answer is None:
                raise PeerRefusedError("unsupported", f"this replica knows no {asked.name!r}: it is of another version")
            async with asyncio.timeout(min(asked.timeout_ms / 1000, LONGEST_S)):
                result = await answer(gateway, asked.payload)
            if len(result) > MESSAGE_BYTES:
                raise TooLargeError(f"the answer has {len(result)} bytes; between replicas {MESSAGE_BYTES} at most")
        except TimeoutError:
            return  # who asked has given up
        except MetarosError as error:
            reply(Kind.REFUSAL, pack_error(error))
        except Exception as error:
            log.exception("%s of the replica %s failed", asked.name, gateway)
            reply(Kind.REFUSAL, pack_error(error))
        else:
            reply(Kind.ANSWER, result)
