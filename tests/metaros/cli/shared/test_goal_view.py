"""What people and machines see of a goal."""

from __future__ import annotations

import pytest

from metaros.cli.shared.goal_view import show_accepted, show_part, show_status
from metaros.cli.shared.options import Format
from metaros.cli.shared.output import Output
from metaros.interfaces.example_interfaces.action import Fibonacci


def test_people_see_each_part_under_its_title(capsys: pytest.CaptureFixture[str]) -> None:
    out = Output()
    show_part(out, "Sending goal", Fibonacci.Goal(order=3))
    show_accepted(out, "ab12")
    show_status(out, "ABORTED")
    assert capsys.readouterr().out == (
        "Sending goal:\n    order: 3\n\nGoal accepted with ID: ab12\n\nGoal finished with status: ABORTED\n"
    )


def test_machines_get_an_object_a_line_of_parts_only_feedback(capsys: pytest.CaptureFixture[str]) -> None:
    out = Output(Format.JSON)
    show_part(out, "Sending goal", Fibonacci.Goal(order=3))
    show_accepted(out, "ab12")
    show_part(out, "Feedback", Fibonacci.Feedback(sequence=[0, 1]))
    assert capsys.readouterr().out.splitlines() == [
        '{"goal_id": "ab12", "accepted": true}',
        '{"feedback": {"sequence": [0, 1]}}',
    ]
