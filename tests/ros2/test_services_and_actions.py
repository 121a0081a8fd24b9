"""Services and actions: answers, feedback, results, refusals and cancels, either side."""

from __future__ import annotations

import pytest

from tests.ros2.participant import PATIENT, GoalRun, Participant, fibonacci
from tests.ros2.scenarios import scenario
from tests.support.waiting import wait_until

pytestmark = pytest.mark.xdist_group("ros2")
SUMS = ((3, 4), (-5, 2), (1 << 40, 1 << 41), (0, 0))


@scenario("services", told="serve", heard="call")
def test_requests_are_answered(teller: Participant, hearer: Participant) -> None:
    assert [hearer.add(teller.name, a, b) for a, b in SUMS] == [a + b for a, b in SUMS]


@scenario("actions: feedback, result, refusal", told="serve goals", heard="send goals")
def test_goals_end_with_results_and_tell_how_it_goes(teller: Participant, hearer: Participant) -> None:
    told, runs = fibonacci(5), list[GoalRun]()

    def heard_all() -> bool:
        """Feedback may come before who asks is known to who tells: another goal then has it all."""
        runs.append(hearer.run_goal(teller.name, 5))
        assert (runs[-1].status, runs[-1].sequence) == ("SUCCEEDED", told[-1])
        assert all(part in told for part in runs[-1].feedback)
        return runs[-1].feedback == told

    wait_until(heard_all)
    assert hearer.run_goal(teller.name, -1) == GoalRun("REJECTED")


@scenario("actions: cancel", told="serve goals", heard="cancel goals")
def test_goals_are_cancelled(teller: Participant, hearer: Participant) -> None:
    run = hearer.run_goal(teller.name, PATIENT + 1, cancel=True)
    assert run.status == "CANCELED"
    assert [0, 1, *fibonacci(PATIENT)[-1][2:]][: len(run.sequence)] == run.sequence
