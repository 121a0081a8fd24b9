"""Passwords: argon2id, two at a time, a bounded queue, the same work whether there is such a user or not."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Iterator

import pytest
from argon2 import PasswordHasher

from gateway.errors import InvalidRequestError, TooManyRequestsError
from gateway.identity.passwords import Passwords, check_password, hash_password
from tests.support.waiting import wait_until_async

FAST = {"time_cost": 1, "memory_cost": 64, "parallelism": 1}


class CountingHasher(PasswordHasher):
    """Says how many checks it does at a time; each waits for `go` when it is to."""

    def __init__(self) -> None:
        super().__init__(**FAST)
        self.go = threading.Event()
        self.go.set()
        self._lock = threading.Lock()
        self.now = self.most = self.done = 0

    def verify(self, hash: str | bytes, password: str | bytes) -> bool:  # noqa: A002  (the library's name)
        """As ever, counted."""
        with self._lock:
            self.now += 1
            self.most = max(self.most, self.now)
        self.go.wait(60)
        try:
            return super().verify(hash, password)
        finally:
            with self._lock:
                self.now -= 1
                self.done += 1


@pytest.fixture
def hasher() -> CountingHasher:
    return CountingHasher()


@pytest.fixture
def passwords(hasher: CountingHasher) -> Iterator[Passwords]:
    made = Passwords(hasher=hasher, waiting=8, threads=2)
    yield made
    hasher.go.set()
    made.close()


async def test_right_and_wrong(passwords: Passwords) -> None:
    stored = await passwords.hash("correct horse battery")
    assert stored.startswith("$argon2id$")
    assert await passwords.verify(stored, "correct horse battery")
    assert not await passwords.verify(stored, "correct horse batterY")
    assert not await passwords.verify(stored, "")
    assert stored != await passwords.hash("correct horse battery")


async def test_nobody_s_password_is_compared_with_the_same_work(passwords: Passwords, hasher: CountingHasher) -> None:
    assert not await passwords.verify("", "nobody's password")
    assert not await passwords.verify("no hash at all", "x")
    assert hasher.done == 2


async def test_two_at_a_time_and_a_bounded_queue(passwords: Passwords, hasher: CountingHasher) -> None:
    stored = hash_password("correct horse battery", hasher=PasswordHasher(**FAST))
    hasher.go.clear()
    checks = [asyncio.create_task(passwords.verify(stored, "correct horse battery")) for _ in range(8)]
    await asyncio.sleep(0)
    with pytest.raises(TooManyRequestsError) as refused:
        await passwords.verify(stored, "correct horse battery")
    assert refused.value.retry_after_s > 0
    await wait_until_async(lambda: hasher.most == 2)
    hasher.go.set()
    assert await asyncio.gather(*checks) == [True] * 8
    assert hasher.most == 2
    assert await passwords.verify(stored, "correct horse battery")


async def test_who_goes_away_still_holds_the_place_that_the_thread_works_for(
    passwords: Passwords, hasher: CountingHasher
) -> None:
    hasher.go.clear()
    checks = [asyncio.create_task(passwords.verify("", "x")) for _ in range(8)]
    await asyncio.sleep(0)
    for check in checks:
        check.cancel()
    await asyncio.gather(*checks, return_exceptions=True)
    with pytest.raises(TooManyRequestsError):
        passwords.check_room()


def test_the_real_parameters_are_the_rfcs_memory_and_passes_on_one_lane() -> None:
    assert hash_password("correct horse battery").startswith("$argon2id$v=19$m=65536,t=3,p=1$")


async def test_weaker_hashes_are_outdated() -> None:
    real = Passwords()
    try:
        assert real.outdated(hash_password("x", hasher=PasswordHasher(**FAST)))
    finally:
        real.close()


async def test_the_same_password_typed_on_another_keyboard(passwords: Passwords) -> None:
    stored = await passwords.hash("grüße vom roboter")  # ü as one character
    assert await passwords.verify(stored, "gru\u0308ße vom roboter")  # and as two


@pytest.mark.parametrize("text", ["", "short", "a" * 257, "aaaaaaaaaaaaaa", "operatoroperator"])
def test_what_is_refused(text: str) -> None:
    with pytest.raises(InvalidRequestError):
        check_password(text, name="operator")


@pytest.mark.parametrize("text", ["correct horse battery", "äöüß-äöüß-äöüß", "x1y2z3" * 40])
def test_what_is_taken(text: str) -> None:
    check_password(text, name="operator")
