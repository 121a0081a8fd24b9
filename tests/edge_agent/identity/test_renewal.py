"""The rule of renewal under a manual clock: two thirds with jitter, slower after failures, grace, jumps."""

from __future__ import annotations

import random  # noqa: TID251 - seeded

from edge_agent.identity.certificate import Validity
from edge_agent.identity.renewal import GRACE_S, LOOK_S, MOST_AGAIN_S, Renewal
from metaros.clock import ManualClock

DAY_S = 86_400.0
NS = 1_000_000_000


def rule(life_s: float = DAY_S, seed: int = 1) -> tuple[Renewal, ManualClock]:
    """A certificate that begins now."""
    clock = ManualClock()
    begin = clock.wall_ns()
    return Renewal(Validity(begin, begin + round(life_s * NS)), clock, random.Random(seed)), clock


def due_after(renewal: Renewal, clock: ManualClock) -> float:
    """Seconds until the rule asks for a renewal, by waiting as it says."""
    began = clock.monotonic_s()
    while (wait_s := renewal.wait_s()) > 0:
        assert wait_s <= LOOK_S
        clock.advance(wait_s)
    return clock.monotonic_s() - began


def test_a_fleet_renews_around_two_thirds_and_not_at_once() -> None:
    shares = [due_after(*rule(seed=seed)) / DAY_S for seed in range(40)]
    assert all(2 / 3 - 0.051 <= share <= 2 / 3 + 0.051 for share in shares)
    assert max(shares) - min(shares) > 0.05


def test_states_follow_the_calendar() -> None:
    renewal, clock = rule()
    seen = []
    for seconds in (0, 0.5 * DAY_S, 0.25 * DAY_S, 0.25 * DAY_S, GRACE_S - 1, 1):
        clock.advance(seconds)
        seen.append(renewal.state)
    assert seen == ["fresh", "fresh", "due", "grace", "grace", "over"]
    assert renewal.wait_s() == 0


def test_failures_slow_it_down_to_an_hour_and_a_success_begins_anew() -> None:
    renewal, clock = rule(life_s=90 * DAY_S)
    due_after(renewal, clock)
    waits = []
    for _ in range(12):
        renewal.failed()
        assert not renewal.may_ask()
        waits.append(due_after(renewal, clock))
        assert renewal.may_ask()
    assert 24 <= waits[0] <= 36
    assert 0.8 * MOST_AGAIN_S <= waits[-1] <= 1.2 * MOST_AGAIN_S
    now = clock.wall_ns()
    renewal.renewed(Validity(now, now + round(DAY_S * NS)))
    assert renewal.state == "fresh"
    assert renewal.may_ask()


def test_a_clock_that_is_set_is_noticed_within_a_minute() -> None:
    renewal, clock = rule()
    assert renewal.wait_s() == LOOK_S
    clock.jump_wall(0.8 * DAY_S)
    assert (renewal.state, renewal.wait_s()) == ("due", 0.0)
    clock.jump_wall(-10 * 365 * DAY_S)
    assert (renewal.state, renewal.wait_s()) == ("fresh", LOOK_S)


def test_a_certificate_of_a_minute_is_retried_within_its_life() -> None:
    renewal, clock = rule(life_s=60)
    due_after(renewal, clock)
    renewal.failed()
    assert due_after(renewal, clock) < 1
