"""Who asks at the Lambda API: the signature of a request turned into a principal. Pure ASGI, outside Authenticate.

Nothing else counts there: no bearer key, no session, no place that somebody comes from. A signature covers the body,
so that has to be here first; it is read only for who names a key that exists, at a time that is about now. A large one
goes to a file. A signature that is not good is remembered, not answered, as with other credentials.
"""

from __future__ import annotations

import asyncio
import contextlib
import hashlib
import tempfile
from dataclasses import dataclass
from pathlib import Path

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from gateway.api.authorization import PRINCIPAL_KEY, REFUSAL_KEY
from gateway.api.aws.errors import SignatureIncompleteError, UnknownAccessKeyError
from gateway.api.aws.paths import CODE_OPERATIONS, Found, find_operation
from gateway.api.aws.prefix import LINKS, is_lambda
from gateway.api.aws.sigv4 import Signature, check_time, read_signature, verify
from gateway.api.middleware.bodies import InFlight
from gateway.api.middleware.rate import Rates, address_of
from gateway.domain.buckets import TokenBuckets
from gateway.domain.principal import NOBODY, Principal
from gateway.errors import BodyTooLargeError, RequestTimeoutError, TooManyRequestsError
from gateway.identity.accounts import Accounts
from metaros.clock import Clock
from metaros.errors import MetarosError
from metaros.limits import LIMITS, Limits

__all__ = ["SIGNED_KEY", "Asked", "Signed"]

SIGNED_KEY = "metaros.lambda"  # of a scope: what was asked, see Asked
SPOOLED_BYTES = 1 << 20  # a request with code is kept in memory up to here
HASHED_BYTES = 256 << 10  # more than that is hashed on a thread
BUSY_S = 1.0
TOLD_S = 60.0  # so often at most a call of the same function by the same key is written into the audit log
CALLS = frozenset({"Invoke", "InvokeAsync", "InvokeWithResponseStream"})
DOCUMENT_BYTES = 256 << 10  # of every other operation: it is parsed at one go


@dataclass(slots=True)
class Asked:
    """A request that was signed: its operation, None where there is none of that path, and its body."""

    found: Found | None
    query: str
    data: bytes = b""
    file: Path | None = None  # a large body
    in_audit: bool = False  # a call like this one is in the audit log already, a minute ago at most


class Signed:
    """Puts the principal and what is asked, or why there is none, into the scope of requests to `/lambda`."""

    def __init__(
        self, app: ASGIApp, accounts: Accounts, rates: Rates, folder: Path, *, clock: Clock, limits: Limits = LIMITS
    ) -> None:
        """`folder` is for large bodies, as long as they are asked about."""
        self._app = app
        self._accounts = accounts
        self._rates = rates
        self._folder = folder
        self._clock = clock
        self._limits = limits
        self._in_flight = InFlight(limits)
        self._uploads = 0
        self._calls = TokenBuckets(per_s=1 / TOLD_S, burst=1.0)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Find out, then pass on."""
        if scope["type"] != "http" or not is_lambda(scope["path"]):
            await self._app(scope, receive, send)
            return
        scope.setdefault("state", {})
        scope[PRINCIPAL_KEY] = NOBODY
        if scope["path"].startswith(LINKS):
            await self._app(scope, receive, send)
            return
        async with _Reading(self, scope, receive) as reading:
            try:
                scope[PRINCIPAL_KEY], scope[SIGNED_KEY] = await self._who(scope, reading)
            except MetarosError as error:
                scope[REFUSAL_KEY] = error
            await self._app(scope, receive, send if reading.whole else _closing(send))

    async def _who(self, scope: Scope, reading: _Reading) -> tuple[Principal, Asked]:
        address = address_of(scope)
        self._rates.check("refused", address)
        try:
            signature = read_signature(scope["headers"])
            check_time(signature, now_ns=self._clock.wall_ns())
            known = await self._accounts.lambda_secret(signature.key_id)
            if known is None:
                raise UnknownAccessKeyError(
                    "The access key id is none of a key with the scope lambda here: metaros key create --scope lambda"
                )
            asked = await reading.read()
            self._verify(scope, signature, known[1], asked, reading.sha256)
        except (BodyTooLargeError, RequestTimeoutError, TooManyRequestsError):
            raise
        except MetarosError:
            self._rates.count("refused", address)
            raise
        asked.in_audit = self._is_in_audit(known[0], asked.found)
        return known[0], asked

    def _is_in_audit(self, principal: Principal, found: Found | None) -> bool:
        """Thousands of calls a second are one row a minute: each of them is in the record of calls."""
        if found is None or found.operation not in CALLS:
            return False
        key = (principal.id, found.members.get("FunctionName"))
        return self._calls.take(key, self._clock.monotonic_s()) > 0

    def _verify(self, scope: Scope, signature: Signature, secret: str, asked: Asked, sha256: str) -> None:
        path = scope["raw_path"].decode("latin-1").partition("?")[0]
        verify(signature, secret, method=scope["method"], path=path, query=asked.query, sha256=sha256)


class _Reading:
    """One request's body, counted and hashed as it comes; what is left of it goes at the end."""

    def __init__(self, middleware: Signed, scope: Scope, receive: Receive) -> None:
        self._middleware = middleware
        self._scope = scope
        self._receive = receive
        self._address = address_of(scope)
        self._counted = 0
        self._digest = hashlib.sha256()
        self._stack = contextlib.AsyncExitStack()
        self.whole = False

    async def __aenter__(self) -> _Reading:
        return self

    async def __aexit__(self, *_exc: object) -> None:
        self._middleware._in_flight.remove(self._address, self._counted)
        await self._stack.aclose()

    @property
    def sha256(self) -> str:
        """Of all that was read, hexadecimal."""
        return self._digest.hexdigest()

    async def read(self) -> Asked:
        """All of it.

        Raises:
            BodyTooLargeError, RequestTimeoutError, TooManyRequestsError: it is over a bound.
        """
        scope = self._scope
        try:
            query = scope["query_string"].decode("ascii")
            path = scope["raw_path"].decode("ascii").partition("?")[0]
        except UnicodeDecodeError as error:
            raise SignatureIncompleteError("an address is ASCII: encode what is not") from error
        asked = Asked(find_operation(scope["method"], path, query), query)
        limits = self._middleware._limits
        large = asked.found is not None and asked.found.operation in CODE_OPERATIONS
        called = asked.found is not None and asked.found.operation in CALLS
        small = limits.function_payload_bytes if called else DOCUMENT_BYTES
        limit = limits.lambda_request_bytes if large else small
        if (said := _said_bytes(scope)) > limit:
            raise BodyTooLargeError(f"Request must be smaller than {limit} bytes for this operation; it has {said}")
        try:
            async with asyncio.timeout(limits.body_s):
                if large and (said > SPOOLED_BYTES or _is_chunked(scope)):
                    await self._to_file(asked, limit)
                else:
                    asked.data = await self._to_memory(limit)
        except TimeoutError:
            raise RequestTimeoutError(f"the body did not come within {limits.body_s:g} s") from None
        self.whole = True
        return asked

    async def _to_memory(self, limit: int) -> bytes:
        pieces: list[bytes] = []
        size = 0
        while True:
            piece, more = await self._piece()
            size += len(piece)
            if size > limit:
                raise BodyTooLargeError(f"Request must be smaller than {limit} bytes for this operation")
            self._middleware._in_flight.add(self._address, len(piece))
            self._counted += len(piece)
            pieces.append(piece)
            if not more:
                break
        data = b"".join(pieces)
        if len(data) > HASHED_BYTES:
            await asyncio.to_thread(self._digest.update, data)
        else:
            self._digest.update(data)
        return data

    async def _to_file(self, asked: Asked, limit: int) -> None:
        middleware = self._middleware
        if middleware._uploads >= middleware._limits.function_uploads:
            raise TooManyRequestsError("too many requests with code are on their way", retry_after_s=BUSY_S)
        middleware._uploads += 1
        self._stack.callback(self._uploaded)
        folder = Path(self._stack.enter_context(tempfile.TemporaryDirectory(dir=middleware._folder, prefix="lambda-")))
        path, size, more = folder / "body", 0, True
        with path.open("wb", buffering=SPOOLED_BYTES) as file:
            while more:
                piece, more = await self._piece()
                size += len(piece)
                if size > limit:
                    raise BodyTooLargeError(f"Request must be smaller than {limit} bytes for this operation")
                self._digest.update(piece)
                file.write(piece)
        asked.file = path if size else None

    def _uploaded(self) -> None:
        self._middleware._uploads -= 1

    async def _piece(self) -> tuple[bytes, bool]:
        limits = self._middleware._limits
        try:
            async with asyncio.timeout(limits.body_idle_s):
                message = await self._receive()
        except TimeoutError:
            raise RequestTimeoutError(f"the body did not come: {limits.body_idle_s:g} s for a piece") from None
        if message["type"] != "http.request":
            raise RequestTimeoutError("the connection ended within the body")
        return message.get("body", b""), message.get("more_body", False)


def _closing(send: Send) -> Send:
    """The rest of a body may still come: the connection ends with the answer."""

    async def wrapped(message: Message) -> None:
        if message["type"] == "http.response.start":
            message = {**message, "headers": [*message.get("headers", []), (b"connection", b"close")]}
        await send(message)

    return wrapped


def _is_chunked(scope: Scope) -> bool:
    return any(key.lower() == b"transfer-encoding" for key, _ in scope["headers"])


def _said_bytes(scope: Scope) -> int:
    """What Content-Length says; Guard has seen that it is a number."""
    return max((int(value) for key, value in scope["headers"] if key.lower() == b"content-length"), default=0)
