"""One request in flight: its answer, how it ends, and how a thread or a coroutine waits for it."""

from __future__ import annotations

import threading
from collections.abc import Callable, Generator, Iterable
from contextlib import suppress
from typing import TYPE_CHECKING, Any, Final, Generic, TypeVar

import zenoh

from metaros.clock import SystemClock
from metaros.concurrency.signals import StopEvent
from metaros.errors import MetarosError, PeerError, TimeoutError_, UnavailableError
from metaros.lazy_import import LazyModule
from metaros.wire import parse_attachment

if TYPE_CHECKING:
    import asyncio
else:
    asyncio = LazyModule("asyncio")

__all__ = ["FOREVER_S", "GRACE_S", "PendingCall", "Reply"]

T = TypeVar("T")
FOREVER_S: Final = 1e9  # Zenoh wants a number: a generation, for what may take as long as it takes
# Calls with a callback end by a timeout of ours, always in the same way. Zenoh's, for those that nobody waits for,
# comes later: it calls back on a thread that advanced publishers of the program's own need for their end (sporadic.py).
GRACE_S: Final = 0.5
_TIMED_OUT: Final = "Timeout"  # what Zenoh puts into the error reply it makes itself


class PendingCall:
    """The answers to one request. It ends once: answered, refused, out of time, cancelled, or failed by the client."""

    def __init__(
        self,
        service: str,
        seq: int,
        gid: bytes,
        timeout_s: float,
        lost: type[UnavailableError] = UnavailableError,
    ) -> None:
        self.seq = seq
        self.lost = lost  # the error where the server goes before it answers
        self._service, self._gid, self._timeout_s = service, gid, timeout_s
        self.due_s = SystemClock.monotonic_s() + timeout_s
        self._lock = threading.Lock()
        self._wakes: list[Callable[[], object]] = []
        self._answer: bytes | None = None
        self._refusal: str | None = None
        self._error: MetarosError | None = None
        self.token = zenoh.CancellationToken()
        self.finished = False
        self._reading = False

    # -- Zenoh's side: direct callbacks, so nothing here may block -------------------------------------------------
    # They run on Zenoh's threads, or, where the server is in this program, on the one that answers: that one spins,
    # and an executor notices a Ctrl-C that Zenoh swallows. Blocking calls read Zenoh's channel instead.

    def take(self, reply: zenoh.Reply) -> None:
        """Keep the first sound answer; an error only counts where no answer comes."""
        if reply.ok is None:
            text = b"" if reply.err is None else reply.err.payload.to_bytes()
            self._refusal = self._refusal or text.decode(errors="replace")
            return
        try:
            attachment = reply.ok.attachment
            sent = parse_attachment(b"" if attachment is None else attachment.to_bytes())
        except PeerError as error:
            self._refusal = f"{error.code}: {error}"
            return
        if self._answer is None and (sent.seq, sent.gid) == (self.seq, self._gid):
            self._answer = reply.ok.payload.to_bytes()
            self.finish()

    def finish(self) -> None:
        """The answer is there, or none will come."""
        with self._lock:
            if self.finished:
                return
            self.finished = True
            wakes, self._wakes = self._wakes, []
        for wake in wakes:
            wake()

    # -- the caller's side -----------------------------------------------------------------------------------------

    def fail(self, error: MetarosError) -> None:
        """End it with an error, unless it has ended; a later answer is ignored."""
        if not self.finished:
            self._error = error
            self.finish()
            if self._reading:
                self.token.cancel()  # type: ignore[no-untyped-call]  # which ends the reader's wait

    def expire(self) -> None:
        """The time for an answer is over."""
        if not self.finished:
            self._refusal = self._refusal or _TIMED_OUT
            self.finish()
            self.token.cancel()  # type: ignore[no-untyped-call]

    def cancel(self) -> None:
        """Nobody waits any more: a later answer is ignored, and Zenoh forgets the query."""
        self.fail(PeerError(f"the call of {self._service} was cancelled"))
        self.token.cancel()  # type: ignore[no-untyped-call]

    def when_finished(self, wake: Callable[[], object]) -> None:
        """Call `wake()` once at the end, perhaps on a Zenoh thread, perhaps at once."""
        with self._lock:
            if not self.finished:
                self._wakes.append(wake)
                return
        wake()

    def read(self, replies: Iterable[zenoh.Reply]) -> bytes:
        """Block on a channel of Zenoh's until the end; the answer's CDR, or an error."""
        self._reading = True
        try:
            if self._error is None:
                for reply in replies:
                    self.take(reply)
                    if self._answer is not None:
                        break
        except BaseException:  # Ctrl-C
            self.token.cancel()  # type: ignore[no-untyped-call]
            raise
        finally:
            self.finish()
        return self.outcome()

    def wait(self) -> bytes:
        """Block until the end; the answer's CDR, or an error."""
        if not self.finished:
            ended = StopEvent()  # the main thread may wait here for a Ctrl-C
            self.when_finished(ended.set)
            try:
                if not ended.wait(min(max(0.0, self.due_s - SystemClock.monotonic_s()), threading.TIMEOUT_MAX)):
                    self.expire()
            finally:
                self._release()
        return self.outcome()

    async def wait_async(self) -> bytes:
        """The same for coroutines; cancelling the task cancels the call."""
        if not self.finished:
            loop, ended = asyncio.get_running_loop(), asyncio.Event()

            def wake() -> None:
                with suppress(RuntimeError):  # the loop was closed: nobody waits there
                    loop.call_soon_threadsafe(ended.set)

            self.when_finished(wake)
            try:
                async with asyncio.timeout(max(0.0, self.due_s - SystemClock.monotonic_s())):
                    await ended.wait()
            except TimeoutError:
                self.expire()
            finally:
                self._release()
        return self.outcome()

    def outcome(self) -> bytes:
        """The answer's CDR, or the error that the call ended with."""
        if self._answer is not None:
            return self._answer
        if self._error is not None:
            raise self._error
        if self._refusal and self._refusal != _TIMED_OUT:
            raise PeerError(f"{self._service} refused the request: {self._refusal}")
        if self.finished and not self._refusal:
            raise self.lost(f"{self._service} ended the call without an answer: its server went, or is overrun")
        raise TimeoutError_(f"no answer from {self._service} within {self._timeout_s:g} s")

    def _release(self) -> None:
        """Where the wait ended before the call did: by Ctrl-C, or a cancelled task."""
        if not self.finished:
            self.token.cancel()  # type: ignore[no-untyped-call]


class Reply(Generic[T]):
    """The response to come: `await` it in a coroutine, or `wait()` for it in a thread."""

    def __init__(self, call: PendingCall, convert: Callable[[bytes], T], check: Callable[[], None]) -> None:
        self._call, self._convert, self._check = call, convert, check

    def wait(self) -> T:
        """Block until it is there; UsageError on a thread that would wait for itself."""
        if not self._call.finished:
            self._check()
        return self._convert(self._call.wait())

    def __await__(self) -> Generator[Any, None, T]:
        return self._later().__await__()

    async def _later(self) -> T:
        return self._convert(await self._call.wait_async())

    @property
    def done(self) -> bool:
        """Whether `wait` would return at once."""
        return self._call.finished

    def cancel(self) -> None:
        """Stop waiting; whoever waits gets a PeerError. The server is not told."""
        self._call.cancel()
