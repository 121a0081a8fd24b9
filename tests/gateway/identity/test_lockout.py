"""How long a guesser waits: arithmetic on a clock that is told what time it is."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gateway.errors import TooManyRequestsError
from gateway.identity.lockout import LockOut, address_group
from gateway.store.accounts.sessions import Failures
from metaros.clock import ManualClock

RULE = LockOut()
SECOND_NS = 10**9


def test_five_attempts_are_free_then_each_doubles_the_wait(clock: ManualClock) -> None:
    state, waits = None, []
    for _ in range(18):
        state = RULE.attempt(state, now_ns=clock.wall_ns())
        waits.append((state.until_ns - clock.wall_ns()) / SECOND_NS)
        clock.advance(waits[-1])
    assert waits[:4] == [0, 0, 0, 0]
    assert waits[4:10] == [1, 2, 4, 8, 16, 32]
    assert waits[14:] == [900, 900, 900, 900]


def test_one_that_comes_too_early_is_refused_and_does_not_count(clock: ManualClock) -> None:
    state = None
    for _ in range(5):
        state = RULE.attempt(state, now_ns=clock.wall_ns())
    clock.advance(0.25)
    for _ in range(3):
        with pytest.raises(TooManyRequestsError) as refused:
            RULE.attempt(state, now_ns=clock.wall_ns())
        assert refused.value.retry_after_s == pytest.approx(0.75)
    clock.advance(0.75)
    assert RULE.attempt(state, now_ns=clock.wall_ns()).failures == 6


def test_an_hour_of_peace_forgets_all(clock: ManualClock) -> None:
    state = Failures(30, clock.wall_ns(), clock.wall_ns() + 900 * SECOND_NS)
    clock.advance(3599)
    assert RULE.attempt(state, now_ns=clock.wall_ns()).failures == 31
    clock.advance(1)
    assert RULE.attempt(state, now_ns=clock.wall_ns()).failures == 1


def test_a_clock_set_back_by_years_locks_nobody_out_for_years(clock: ManualClock) -> None:
    state = Failures(30, clock.wall_ns(), clock.wall_ns() + 900 * SECOND_NS)
    clock.jump_wall(-10 * 365 * 86_400)
    with pytest.raises(TooManyRequestsError) as refused:
        RULE.attempt(state, now_ns=clock.wall_ns())
    assert refused.value.retry_after_s == 900


def test_guesses_of_a_day_are_few(clock: ManualClock) -> None:
    """Who tries as soon as it may gets about a hundred attempts a day."""
    state, tried, start = None, 0, clock.wall_ns()
    while clock.wall_ns() - start < 86_400 * SECOND_NS:
        state = RULE.attempt(state, now_ns=clock.wall_ns())
        tried += 1
        clock.advance(RULE.delay_s(state.failures))
    assert 100 <= tried <= 120


@given(st.integers(0, 10**7))
def test_the_wait_grows_and_is_bounded(failures: int) -> None:
    assert 0.0 <= RULE.delay_s(failures) <= RULE.delay_s(failures + 1) <= RULE.most_s


@pytest.mark.parametrize(
    ("address", "group"),
    [
        ("127.0.0.1", "127.0.0.1"),
        ("::ffff:10.0.0.9", "10.0.0.9"),
        ("2001:db8:1:2:3:4:5:6", "2001:db8:1:2::/64"),
        ("2001:db8:1:2::9%eth0", "2001:db8:1:2::/64"),
        ("", ""),
        ("ünix", "?nix"),
        ("a" * 100, "a" * 64),
    ],
)
def test_what_counts_as_one_address(address: str, group: str) -> None:
    assert address_group(address) == group
