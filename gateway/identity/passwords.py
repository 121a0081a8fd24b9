"""Password hashing: argon2id on two threads of their own, with a bounded queue.

One check takes about 0.1 s and 64 MiB. Two at a time bound the memory; a bounded queue before them bounds the wait.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import sys
import threading
import unicodedata
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

from argon2 import PasswordHasher
from argon2.exceptions import InvalidHashError, VerificationError

from gateway.errors import InvalidRequestError, TooManyRequestsError
from metaros.limits import LIMITS

__all__ = ["MIN_CHARS", "Passwords", "check_password", "hash_password"]

Result = TypeVar("Result")
AT_A_TIME = 2
NICE = 10
BUSY_S = 5.0
MIN_CHARS = 12
LANES = 1  # argon2's parallelism: its default of 4 threads a hash would take every core of a small machine at once


def check_password(text: str, *, name: str) -> None:
    """InvalidRequestError for a password that is too short, too long, or hardly more than the user's name."""
    if not MIN_CHARS <= len(text) <= LIMITS.password_chars:
        raise InvalidRequestError(f"a password has {MIN_CHARS} to {LIMITS.password_chars} characters")
    if len(set(text)) < 5 or text.casefold().replace(name.casefold(), "") == "":
        raise InvalidRequestError("this password is too easy to guess")


def hash_password(text: str, *, hasher: PasswordHasher | None = None) -> str:
    """The password's argon2id hash with its salt and parameters; takes its time, and 64 MiB."""
    return (hasher or PasswordHasher(parallelism=LANES)).hash(_bytes(text))


class Passwords:
    """Hashes and checks for an event loop; `close` when it ends."""

    def __init__(
        self, *, hasher: PasswordHasher | None = None, waiting: int = LIMITS.password_checks, threads: int | None = None
    ) -> None:
        self._hasher = hasher or PasswordHasher(parallelism=LANES)
        self._pool = ThreadPoolExecutor(
            max_workers=threads or _at_a_time(), thread_name_prefix="gateway-password", initializer=_give_way
        )
        self._most = waiting
        self._under_way = 0
        self._nobody: str | None = None  # what is compared where there is no such user, so that it takes as long

    async def hash(self, text: str) -> str:
        """The hash to store."""
        return await self._run(lambda: hash_password(text, hasher=self._hasher))

    async def verify(self, stored: str, text: str) -> bool:
        """Whether the password is that of the hash; "" is nobody's hash: False after the same time."""
        return await self._run(lambda: self._verify(stored, text))

    def outdated(self, stored: str) -> bool:
        """Whether a hash was made with weaker parameters than today's."""
        return self._hasher.check_needs_rehash(stored)

    def close(self) -> None:
        """Let the threads go."""
        self._pool.shutdown(wait=False, cancel_futures=True)

    def _verify(self, stored: str, text: str) -> bool:
        if self._nobody is None:
            self._nobody = self._hasher.hash("nobody's password")
        good = False
        with contextlib.suppress(VerificationError, InvalidHashError):
            good = self._hasher.verify(stored or self._nobody, _bytes(text))
        return good and bool(stored)

    def check_room(self) -> None:
        """TooManyRequestsError when too many wait already: said before an attempt counts."""
        if self._under_way >= self._most:
            raise TooManyRequestsError("too many sign-ins at once: try again", retry_after_s=BUSY_S)

    async def _run(self, job: Callable[[], Result]) -> Result:
        """On a thread, within the bound."""
        self.check_room()
        self._under_way += 1
        future = asyncio.get_running_loop().run_in_executor(self._pool, job)
        future.add_done_callback(self._done)  # not when who asked goes away: the thread works on
        return await asyncio.shield(future)

    def _done(self, future: asyncio.Future[Any]) -> None:
        self._under_way -= 1
        if not future.cancelled():
            future.exception()  # seen, also where nobody waits any more


def _at_a_time() -> int:
    """Two, and one where there are two cores: the other is the event loop's."""
    return max(1, min(AT_A_TIME, (os.cpu_count() or 2) - 1))


def _give_way() -> None:
    """A hash has time, what robots and viewers wait for has not: on Linux a thread's priority is its own."""
    if sys.platform == "linux":
        with contextlib.suppress(OSError):
            os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), NICE)


def _bytes(text: str) -> bytes:
    """The same password typed on another keyboard gives the same bytes."""
    return unicodedata.normalize("NFKC", text[: LIMITS.password_chars + 1]).encode("utf-8", "surrogatepass")
