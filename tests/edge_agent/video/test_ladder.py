"""The bit rate goes down at once and up step by step, and never beyond the budget."""

from __future__ import annotations

import itertools

from hypothesis import given
from hypothesis import strategies as st

from edge_agent.video.ladder import CALM_S, RUNGS_BPS, Ladder


def test_nothing_is_asked_while_the_link_keeps_up() -> None:
    ladder = Ladder()
    assert [ladder.look(behind=False, sent_bps=9e6, most_bps=0, now_s=now_s) for now_s in range(30)] == [0] * 30


def test_down_to_what_went_through_and_lower_while_that_is_too_much() -> None:
    ladder = Ladder()
    assert ladder.look(behind=True, sent_bps=2e6, most_bps=0, now_s=0) == 1_600_000
    assert ladder.look(behind=True, sent_bps=2e6, most_bps=0, now_s=0.5) == 1_600_000, "it has to have its effect"
    assert ladder.look(behind=True, sent_bps=2e6, most_bps=0, now_s=1) == 1_000_000
    assert ladder.look(behind=True, sent_bps=100, most_bps=0, now_s=2) == RUNGS_BPS[0]
    assert ladder.look(behind=True, sent_bps=0, most_bps=0, now_s=3) == RUNGS_BPS[0]


def test_up_again_one_step_at_a_time() -> None:
    ladder = Ladder()
    ladder.look(behind=True, sent_bps=0, most_bps=0, now_s=0)
    seen = [ladder.look(behind=False, sent_bps=1e6, most_bps=0, now_s=now_s) for now_s in range(1, 45)]
    assert [rate for last, rate in itertools.pairwise(seen) if rate != last] == [*RUNGS_BPS[1:], 0]
    assert seen.index(RUNGS_BPS[1]) + 1 == CALM_S


def test_a_budget_is_never_passed() -> None:
    ladder = Ladder()
    assert ladder.look(behind=False, sent_bps=1e6, most_bps=700_000, now_s=0) == 650_000
    assert ladder.look(behind=False, sent_bps=1e6, most_bps=1e9, now_s=1) == RUNGS_BPS[-1]
    assert ladder.look(behind=False, sent_bps=1e6, most_bps=1, now_s=2) == RUNGS_BPS[0]


@given(st.lists(st.tuples(st.booleans(), st.floats(0, 1e9), st.floats(0, 1e8)), max_size=40))
def test_it_is_always_a_rung_or_nothing(looks: list[tuple[bool, float, float]]) -> None:
    ladder = Ladder()
    for now_s, (behind, sent_bps, most_bps) in enumerate(looks):
        asked = ladder.look(behind=behind, sent_bps=sent_bps, most_bps=most_bps, now_s=now_s)
        assert asked in {0, *RUNGS_BPS}
        assert not most_bps or 0 < asked <= max(most_bps, RUNGS_BPS[0])
