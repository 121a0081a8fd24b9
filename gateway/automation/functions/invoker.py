"""Calling a function: from its name to a worker and back, counted and kept. All methods on the event loop."""

from __future__ import annotations

import asyncio
import uuid
from collections import Counter
from collections.abc import AsyncIterator, Awaitable, Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import orjson

from gateway.automation.functions.async_put import event_put
from gateway.automation.functions.directory import Directory, Resolved
from gateway.automation.functions.errors import FunctionsOffError
from gateway.automation.functions.ledger import Ledger
from gateway.domain.automation.delivery import Put
from gateway.domain.automation.invocation import ERROR, OK, THROTTLED, TIMEOUT, Recorded
from gateway.domain.fleet.command import new_command_id
from metaros.automation.functions.calls import FunctionSpec, Invocation, Outcome
from metaros.automation.functions.errors import ThrottledError
from metaros.clock import Clock
from metaros.errors import TooLargeError
from metaros.limits import LIMITS, Limits

__all__ = ["Call", "Invoked", "Invoker", "RemoteInvoke", "Rng", "Runner", "Stream", "error_of"]

TIMED_OUT = "Sandbox.Timeout"
MESSAGE_CHARS = 2000
PARSED_BYTES = 64 << 10  # of an error's document


class Rng(Protocol):
    """Chance: a `random.Random` of whoever made it."""

    def random(self) -> float:
        """0 to 1, 1 excluded."""

    def getrandbits(self, k: int, /) -> int:
        """So many bits."""


class Runner(Protocol):
    """What is needed of the engine."""

    async def invoke(self, spec: FunctionSpec, call: Invocation) -> Outcome:
        """Run one call."""

    def stream(self, spec: FunctionSpec, call: Invocation) -> AsyncIterator[bytes | Outcome]:
        """Run one call, its answer piece by piece; last comes the outcome."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Call:
    """About a call besides its payload. `request_id` is the same for each attempt of one event; "": a new one."""

    kind: str = "request"
    robot: str = ""
    request_id: str = ""
    client_context: str = ""
    trace_id: str = ""


@dataclass(frozen=True, slots=True)
class Invoked:
    """A call that was made, whatever came of it."""

    outcome: Outcome
    version: str
    request_id: str


RemoteInvoke = Callable[[str, str, bytes, Call], Awaitable[Invoked]]  # calls a function at another gateway


@dataclass(frozen=True, slots=True)
class Stream:
    """A call that goes on; the last of `chunks` is its Outcome."""

    version: str
    request_id: str
    chunks: AsyncIterator[bytes | Outcome]


@dataclass(frozen=True, slots=True)
class _Begun:
    """A call under way."""

    target: Resolved
    version: str
    spec: FunctionSpec
    order: Invocation
    call: Call
    began_ns: int


class Invoker:
    """Calls functions, and tells `listeners` what came of each: function, qualifier, version, whether it went well."""

    def __init__(
        self,
        engine: Runner,
        directory: Directory,
        ledger: Ledger,
        *,
        accept: Callable[[Sequence[Put]], Awaitable[Sequence[str]]],
        clock: Clock,
        rng: Rng,
        limits: Limits = LIMITS,
    ) -> None:
        self._engine = engine
        self._directory = directory
        self._ledger = ledger
        self._accept = accept
        self._clock = clock
        self._rng = rng
        self._limits = limits
        self.remote: RemoteInvoke | None = None  # where this gateway runs no functions: another one does
        self.running: Counter[str] = Counter()  # calls of each function
        self._over = asyncio.Event()
        self.listeners: list[Callable[[str, str, str, bool], None]] = []

    async def invoke(
        self,
        function: str,
        qualifier: str,
        payload: bytes,
        *,
        client_context: str = "",
        trace_id: str = "",
        kind: str = "request",
        robot: str = "",
        request_id: str = "",
    ) -> Invoked:
        """Call a function and wait for what comes of it; that it fails is an Outcome. Its log is there for any call.

        Raises:
            UnknownFunctionError: there is none of that name and qualifier.
            ThrottledError: there is no room for the call now.
            EngineClosedError: the gateway ends.
            TooLargeError: the payload is.
        """
        call = Call(kind=kind, robot=robot, request_id=request_id, client_context=client_context, trace_id=trace_id)
        if self.remote is not None:
            self._check_size(payload, self._limits.function_payload_bytes)
            self._directory.resolve(function, qualifier)
            return await self.remote(function, qualifier, payload, call)
        begun = await self._begin(function, qualifier, payload, call)
        self.running[begun.target.name] += 1
        try:
            outcome = await self._engine.invoke(begun.spec, begun.order)
        except ThrottledError as error:
            self._throttled(begun, error)
            raise
        finally:
            self._leave(begun.target.name)
        self._ended(begun, outcome)
        return Invoked(outcome, begun.version, begun.order.request_id)

    async def open_stream(
        self,
        function: str,
        qualifier: str,
        payload: bytes,
        *,
        client_context: str = "",
        trace_id: str = "",
    ) -> Stream:
        """Call a function whose answer comes piece by piece; what `invoke` raises is raised before the first one."""
        if self.remote is not None:
            raise FunctionsOffError("a streamed answer comes from a gateway that runs functions; this one does not")
        begun = await self._begin(function, qualifier, payload, Call(client_context=client_context, trace_id=trace_id))
        pieces = self._pieces(begun)
        first = await anext(pieces)
        return Stream(begun.version, begun.order.request_id, _again(first, pieces))

    async def accept(
        self,
        function: str,
        qualifier: str,
        payload: bytes,
        *,
        client_context: str = "",
        trace_id: str = "",
        robot: str = "",
        event_id: str = "",
        dedup: str = "",
    ) -> str:
        """Take an event in for a function, durably; the request's id. It is called later, and again where it fails."""
        self._check_size(payload, self._limits.function_event_bytes)
        target = self._directory.resolve(function, qualifier)
        request_id = self.new_request_id()
        put = event_put(
            target.name,
            target.qualifier,
            payload,
            request_id=request_id,
            settings=self._directory.event_invoke(target.name, target.qualifier),
            client_context=client_context,
            trace_id=trace_id,
            robot=robot,
            event_id=event_id,
            dedup=dedup,
        )
        await self._accept([put])
        return request_id

    async def idle(self) -> None:
        """Return when no call is under way."""
        while self.running:
            self._over.clear()
            await self._over.wait()

    def new_request_id(self) -> str:
        """As Lambda's are: a UUID."""
        return str(uuid.UUID(int=self._rng.getrandbits(128), version=4))

    async def _begin(self, function: str, qualifier: str, payload: bytes, call: Call) -> _Begun:
        """Choose a version, and have it at hand."""
        self._check_size(payload, self._limits.function_payload_bytes)
        target = self._directory.resolve(function, qualifier)
        version = target.pick(self._rng.random())
        spec = await self._directory.spec(target.name, version)
        order = Invocation(
            request_id=call.request_id or self.new_request_id(),
            payload=payload,
            arn=target.arn,
            client_context=call.client_context,
            trace_id=call.trace_id,
            tail=True,  # the record keeps it, whoever asks
        )
        return _Begun(target, version, spec, order, call, self._clock.wall_ns())

    async def _pieces(self, begun: _Begun) -> AsyncIterator[bytes | Outcome]:
        self.running[begun.target.name] += 1
        try:
            async for piece in self._engine.stream(begun.spec, begun.order):
                if isinstance(piece, Outcome):
                    self._ended(begun, piece)
                yield piece
        except ThrottledError as error:
            self._throttled(begun, error)
            raise
        finally:
            self._leave(begun.target.name)

    def _leave(self, function: str) -> None:
        self.running[function] -= 1
        if not self.running[function]:
            del self.running[function]
            self._over.set()

    def _ended(self, begun: _Begun, outcome: Outcome) -> None:
        failed = TIMEOUT if outcome.error_type == TIMED_OUT else ERROR
        self._keep(begun, OK if outcome.ok else failed, outcome)
        for listener in self.listeners:
            listener(begun.target.name, begun.target.qualifier, begun.version, outcome.ok)

    def _throttled(self, begun: _Begun, error: ThrottledError) -> None:
        said = orjson.dumps({"errorMessage": str(error)})
        self._keep(begun, THROTTLED, Outcome(payload=said, error_type=error.reason))

    def _keep(self, begun: _Begun, status: str, outcome: Outcome) -> None:
        self._ledger.add(
            Recorded(
                id=new_command_id(begun.began_ns),
                request_id=begun.order.request_id,
                function=begun.target.name,
                version=begun.version,
                qualifier=begun.target.qualifier,
                kind=begun.call.kind,
                robot=begun.call.robot,
                status=status,
                error_type=outcome.error_type[:200],
                error_message="" if outcome.ok else error_of(outcome)[:MESSAGE_CHARS],
                began_ns=begun.began_ns,
                duration_ms=outcome.duration_ms,
                init_ms=outcome.init_ms,
                max_memory_mb=outcome.max_memory_mb,
                log=outcome.log[-self._limits.function_tail_bytes :].decode("utf-8", "replace"),
            )
        )

    def _check_size(self, payload: bytes, most: int) -> None:
        if len(payload) > most:
            raise TooLargeError(f"a payload of {len(payload)} bytes is over the limit of {most}")


def error_of(outcome: Outcome) -> str:
    """What a failed call says is wrong; the beginning of a document that is too large to be parsed at one go."""
    if len(outcome.payload) > PARSED_BYTES:
        return outcome.payload[:MESSAGE_CHARS].decode("utf-8", "replace")
    try:
        document: Any = orjson.loads(outcome.payload)
    except orjson.JSONDecodeError:
        return ""
    said = document.get("errorMessage") if isinstance(document, dict) else None
    return said if isinstance(said, str) else ""


async def _again(first: bytes | Outcome, rest: AsyncIterator[bytes | Outcome]) -> AsyncIterator[bytes | Outcome]:
    yield first
    async for piece in rest:
        yield piece
