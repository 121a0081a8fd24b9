"""When a delivery is tried again, and when it is given up."""

from __future__ import annotations

import random  # noqa: TID251 - seeded

import pytest

from gateway.automation.queue.backoff import attempt_result, wait_s
from gateway.domain.automation.delivery import DEAD, DONE, WAITING, Dead, Delivery, Done, Policy, Put, Retry

NOW = 1_700_000_000_000_000_000
S = 1_000_000_000
LAMBDA = Policy(backoff="lambda")


def tried(attempts: int = 0, tries: int = 1, policy: Policy = LAMBDA) -> Delivery:
    """A delivery in its so-many-th try."""
    put = Put(kind="function", target="t", payload=b"", policy=policy)
    return Delivery(
        id="d",
        put=put,
        state="leased",
        born_ns=NOW,
        due_ns=NOW,
        expires_ns=NOW + 200 * S,
        attempts=attempts,
        tries=tries,
    )


@pytest.mark.parametrize(("attempts", "pause_s"), [(0, 60), (1, 120)])
def test_a_function_that_failed_waits_its_minutes(attempts: int, pause_s: int) -> None:
    outcome = attempt_result(tried(attempts, attempts + 1), Retry("c", "m"), rng=random.Random(1), now_ns=NOW)
    assert (outcome.state, outcome.attempts, outcome.due_ns) == (WAITING, attempts + 1, NOW + pause_s * S)


def test_after_its_last_attempt_it_is_dead_of_what_it_failed_by() -> None:
    outcome = attempt_result(tried(2, 3), Retry("broken", "why\0not"), rng=random.Random(1), now_ns=NOW)
    assert (outcome.state, outcome.attempts, outcome.code, outcome.message) == (DEAD, 3, "broken", "why\ufffdnot")


def test_what_does_not_count_is_tried_as_long_as_it_is_young_enough() -> None:
    outcome = attempt_result(tried(2, 5000), Retry("throttled", counts=False), rng=random.Random(1), now_ns=NOW)
    assert (outcome.state, outcome.attempts) == (WAITING, 2)
    assert NOW < outcome.due_ns <= NOW + 200 * S
    late = attempt_result(tried(), Retry("away", after_s=900.0, counts=False), rng=random.Random(1), now_ns=NOW)
    assert late.due_ns == NOW + 200 * S  # then it is found too old


def test_ends_are_ends() -> None:
    follow = Put(kind="k", target="u", payload=b"")
    done = attempt_result(tried(), Done("fine", [follow]), rng=random.Random(1), now_ns=NOW)
    assert (done.state, done.attempts, done.message, done.puts) == (DONE, 0, "fine", [follow])
    assert attempt_result(tried(), Dead("c"), rng=random.Random(1), now_ns=NOW).state == DEAD


def test_the_pause_is_anywhere_below_a_bound_that_doubles_to_its_most() -> None:
    rng = random.Random(7)
    policy = Policy(first_s=1.0, most_s=300.0)
    for place, bound_s in enumerate((1, 2, 4, 8, 16, 32, 64, 128, 256, 300, 300), start=1):
        pauses = [wait_s(policy, place, counts=place % 2 == 0, rng=rng) for _ in range(400)]
        assert 0.9 * bound_s < max(pauses) <= bound_s
        assert min(pauses) < 0.1 * bound_s
    assert wait_s(policy, 10_000, counts=True, rng=rng) <= 300.0
    assert wait_s(LAMBDA, 1, counts=False, rng=rng) <= 1.0
