"""pending, firing, clearing: by time that was looked at."""

from __future__ import annotations

import numpy as np
import pytest

from gateway.alerting.anomaly.condition_states import ConditionStates

ROW = np.array([0])


def run(
    holds: ConditionStates, steps: list[tuple[float, bool, bool]], *, for_s: float = 3.0, clear_s: float = 2.0
) -> str:
    """`o` where it opened, `c` where it cleared, `.` else."""
    said = ""
    for now_s, breached, inside in steps:
        opened, cleared = holds.step(
            ROW, np.array([breached]), np.array([inside]), now_s, for_s=np.array([for_s]), clear_s=np.array([clear_s])
        )
        said += "o" if opened[0] else "c" if cleared[0] else "."
    return said


@pytest.fixture
def holds() -> ConditionStates:
    made = ConditionStates()
    made.columns.grow(1)
    return made


def test_it_opens_after_for_and_clears_after_clear(holds: ConditionStates) -> None:
    states = [(True, False)] * 5 + [(False, True)] * 5
    assert run(holds, [(float(n), *state) for n, state in enumerate(states)]) == "...o...c.."


def test_between_breached_and_inside_nothing_changes(holds: ConditionStates) -> None:
    states = (
        [(True, False)] * 4
        + [(False, False)] * 3
        + [(False, True), (False, False), (False, True)]
        + [(False, True)] * 3
    )
    assert run(holds, [(float(n), *state) for n, state in enumerate(states)]) == "...o.......c."


def test_a_short_breach_says_nothing_and_none_is_needed_for_zero(holds: ConditionStates) -> None:
    assert run(holds, [(0.0, True, False), (1.0, True, False), (2.0, False, True), (3.0, True, False)]) == "...."
    other = ConditionStates()
    other.columns.grow(1)
    assert run(other, [(0.0, True, False), (1.0, False, True)], for_s=0.0, clear_s=0.0) == "oc"


def test_years_without_a_look_and_a_clock_set_back_open_nothing(holds: ConditionStates) -> None:
    assert run(holds, [(0.0, True, False), (3e8, True, False)], for_s=300.0) == ".."
    assert run(holds, [(5.0, True, False), (6.0, True, False)], for_s=300.0) == ".."
    assert 60.0 <= holds.columns["held_s"][0] <= 62.0
