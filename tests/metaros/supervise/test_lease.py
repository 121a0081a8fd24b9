"""Leases of migratable nodes: a node never runs past the end, whatever comes late, twice, or not at all."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from metaros.supervise.lease import GRACE_SHARE, KILL_BEFORE_S, MARGIN_S, LeaseAction, Leases
from tests.support.tables import cases

GRACE_S = 1.0


def given_lease(valid_s: float = 10.0, *, age_s: float = 0.0, now_s: float = 100.0) -> Leases:
    leases = Leases()
    leases.replace([("arm", "a", valid_s)], age_s=age_s, now_s=now_s)
    return leases


def test_without_a_lease_nothing_runs() -> None:
    assert Leases().duty("arm", GRACE_S, 0.0) is LeaseAction.KILL


@cases(
    ("now_s", "duty"),
    [
        (100.0, LeaseAction.RUN),
        (110.0 - KILL_BEFORE_S - MARGIN_S - GRACE_S - 0.01, LeaseAction.RUN),
        (110.0 - KILL_BEFORE_S - MARGIN_S - GRACE_S + 0.01, LeaseAction.STOP),
        (110.0 - KILL_BEFORE_S + 0.01, LeaseAction.KILL),
        (1e9, LeaseAction.KILL),
    ],
)
def test_it_is_stopped_so_early_that_its_grace_fits_in(now_s: float, duty: LeaseAction) -> None:
    assert given_lease().duty("arm", GRACE_S, now_s) is duty


def test_a_long_grace_takes_a_share_of_a_short_lease() -> None:
    lease = given_lease(3.0).get("arm")
    assert lease is not None
    assert lease.grace_s(600.0) == pytest.approx(GRACE_SHARE * 3.0)
    assert lease.stop_at_s(600.0) > 101.0


def test_the_age_of_the_words_counts() -> None:
    assert given_lease(10.0, age_s=11.0).duty("arm", GRACE_S, 100.0) is LeaseAction.KILL
    assert given_lease(10.0, age_s=-5.0).duty("arm", GRACE_S, 109.99) is LeaseAction.KILL  # nobody's clock lengthens it


def test_a_newer_word_may_shorten_it() -> None:
    leases = given_lease(10.0)
    leases.replace([("arm", "a", 2.0)], age_s=0.0, now_s=101.0)
    lease = leases.get("arm")
    assert lease is not None
    assert lease.until_s == 103.0


def test_an_older_word_changes_nothing() -> None:
    leases = given_lease(10.0)
    leases.replace([], age_s=5.0, now_s=100.1)
    leases.replace([("arm", "a", 10.0)], age_s=5.0, now_s=100.1)
    lease = leases.get("arm")
    assert lease is not None
    assert lease.until_s == 110.0


def test_what_is_taken_back_stops_now_and_is_dead_by_its_old_end() -> None:
    leases = given_lease(10.0)
    leases.replace([], age_s=0.0, now_s=101.0)
    assert leases.duty("arm", GRACE_S, 101.0) is LeaseAction.STOP
    leases.replace([], age_s=0.0, now_s=105.0)
    assert leases.duty("arm", GRACE_S, 105.0) is LeaseAction.STOP
    assert leases.duty("arm", GRACE_S, 110.0) is LeaseAction.KILL
    leases.replace([], age_s=0.0, now_s=111.0)
    assert len(leases) == 0


def test_it_says_when_to_look_again() -> None:
    leases = given_lease(10.0)
    graces = {"arm": GRACE_S, "other": 1.0}
    stop_s = leases.next_s(graces, 100.0)
    assert stop_s is not None
    assert stop_s == pytest.approx(110.0 - KILL_BEFORE_S - MARGIN_S - GRACE_S)
    assert leases.next_s(graces, stop_s) == pytest.approx(110.0 - KILL_BEFORE_S)
    assert leases.next_s(graces, 110.0) is None


@settings(max_examples=40)
@given(
    st.lists(
        st.tuples(st.floats(0, 5), st.sampled_from(["a", "b"]), st.floats(0, 20), st.floats(0, 20)),
        max_size=30,
    )
)
def test_no_word_lets_it_run_past_the_end_of_the_newest_lease(
    words: list[tuple[float, str, float, float]],
) -> None:
    """The gateway's view: a lease given at g for v ends at g + v, however late and in whatever order words come."""
    leases, now_s, ends_s = Leases(), 100.0, 0.0
    for pause_s, lease_id, age_s, valid_s in words:
        now_s += pause_s
        leases.replace([("arm", lease_id, valid_s)], age_s=age_s, now_s=now_s)
        ends_s = max(ends_s, now_s - age_s + valid_s)
    assert leases.duty("arm", GRACE_S, ends_s) is LeaseAction.KILL
