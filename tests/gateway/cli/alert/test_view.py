"""What `metaros alert` prints for people: numbers, gauges, rows and one alert in full."""

from __future__ import annotations

from typing import Any

import pytest

from gateway.cli.alert.view import gauge, number, show_alert, show_change, span, state, table_row
from metaros.cli.shared.output import Output

OPENED_NS = 1_795_349_405_000_000_000  # 2026-11-22 12:10:05
ALERT: dict[str, Any] = {
    "id": "01KB2Y4P5ZQ7W3M8T6X9R0N1VD",
    "robot": "sim_2",
    "cause": "heat",
    "state": "open",
    "severity": "error",
    "title": "Too hot",
    "reason": "84.3 °C, above 80 °C for 5 s",
    "series": "motor_left.temperature",
    "detector": "motor_hot",
    "score": 0.93,
    "value": 84.3,
    "low": 35.2,
    "high": 61.0,
    "opened": "2026-11-22T12:10:05.000Z",
    "resolved": None,
    "resolved_by": "",
    "acknowledged": None,
    "acknowledged_by": "",
    "assignee": "",
    "times": 1,
    "clip": "",
    "inhibited_by": "",
    "silence": "",
    "path": "/robots/sim_2?t=2026-11-22T12:10:04.000Z&span=15m",
}
FINDING = {
    "detector": "motor_hot",
    "series": "motor_left.temperature",
    "severity": "error",
    "value": 84.3,
    "low": None,
    "high": 80.0,
    "reason": "above 80",
    "at": "2026-11-22T12:10:04.000Z",
    "active": True,
}
REMARK = {"number": 1, "at": "2026-11-22T12:12:00.000Z", "by": "", "kind": "clip", "text": "\x1b[31m"}


def shown(capsys: pytest.CaptureFixture[str], **changes: Any) -> list[str]:
    """The lines of `metaros alert show`, two minutes after it opened."""
    show_alert(Output(), {**ALERT, **changes}, now_ns=OPENED_NS + 125_000_000_000, origin="http://here")
    return [line.strip() for line in capsys.readouterr().out.splitlines()]


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, "–"),
        (0.0, "0"),
        (84.31, "84.31"),
        (100.0, "100"),
        (0.2, "0.2"),
        (1234.56, "1235"),
        (-0.05, "-0.05"),
        (2.5e-7, "2.5e-07"),
        (3e9, "3e+09"),
    ],
)
def test_numbers_are_as_short_as_people_read_them(value: float | None, text: str) -> None:
    assert number(value) == text


@pytest.mark.parametrize(
    ("low", "high", "value", "text"),
    [
        (0.0, 10.0, 33.0, "├─────────┤                      ●  33, expected 0 to 10"),
        (0.0, 33.0, 33.0, "├────────────────────────────────●  33, expected 0 to 33"),
        (5.0, 5.0, 38.0, "┼                                ●  38, expected 5"),
        (5.0, 5.0, 5.0, "5, expected 5"),
        (0.0, 10.0, float("inf"), "inf, expected 0 to 10"),
        (None, 20.0, 30.0, "────────────────┤                ●  30, expected up to 20"),
        (None, 20.0, 10.0, "────────────────●────────────────┤  10, expected up to 20"),
        (30.0, None, 20.0, "●               ├─────────────────  20, expected from 30"),
    ],
)
def test_a_value_is_drawn_beside_what_was_expected(
    low: float | None, high: float | None, value: float, text: str
) -> None:
    assert gauge(low, high, value) == text


def test_spans_are_as_they_were_set() -> None:
    assert [span(seconds) for seconds in (0, 5, 90, 300, 3600, 5400)] == [
        "–",
        "5 s",
        "1 min 30 s",
        "5 min",
        "1 h",
        "1 h 30 min",
    ]


def test_rows_say_why_nobody_is_reported() -> None:
    assert table_row(ALERT)[1:] == ("sim_2", "error", "open", "Too hot", "11-22 12:10:05", "")
    assert table_row({**ALERT, "times": 3})[-1] == 3
    assert state({**ALERT, "silence": "01K"}) == "open, silenced"
    assert state({**ALERT, "inhibited_by": "01K"}) == "open, explained by another"
    taken = {**ALERT, "state": "acknowledged", "acknowledged_by": "ada"}
    assert state(taken) == "acknowledged by ada"
    assert state({**ALERT, "state": "resolved", "silence": "01K"}) == "resolved"


def test_an_alert_in_full(capsys: pytest.CaptureFixture[str]) -> None:
    lines = shown(capsys, findings=[FINDING], remarks=[REMARK], times=2, clip="01KC")
    assert lines[:2] == ["▲ Too hot", "84.3 °C, above 80 °C for 5 s"]
    assert lines[3].endswith("84.3, expected 35.2 to 61")
    assert "opened    11-22 12:10:05 UTC, 2 min 5 s ago, for the 2nd time" in lines
    assert "evidence  metaros recording get 01KC" in lines
    assert "page      http://here/robots/sim_2?t=2026-11-22T12:10:04.000Z&span=15m" in lines
    assert "motor_hot  motor_left.temperature  error  84.3  up to 80  11-22 12:10:04  above 80" in lines
    assert "11-22 12:12:00  metaros  clip  \\x1b[31m" in lines, "and nothing of it is obeyed"


def test_an_alert_that_is_over(capsys: pytest.CaptureFixture[str]) -> None:
    over = {"state": "resolved", "resolved": "2026-11-22T12:11:00.000Z", "value": None}
    lines = shown(capsys, **over)
    assert lines[0] == "✓ Too hot"
    assert "resolved  11-22 12:11:00 UTC by itself" in lines
    assert not any("expected" in line for line in lines)


def test_a_change_is_a_line(capsys: pytest.CaptureFixture[str]) -> None:
    data = {"alert": "01K", "severity": "error", "title": "Too hot", "reason": "84 °C"}
    event = {"time": "2026-11-22T12:10:05.000Z", "subject": "sim_2", "data": data}
    show_change(Output(), "opened", event)
    assert capsys.readouterr().out == "12:10:05  01K  ▲ opened        error    sim_2     Too hot: 84 °C\n"
