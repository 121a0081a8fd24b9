"""The table of checks: rows that make sense, found by the series' names."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from gateway.alerting.anomaly.checks import Check, CheckTable
from gateway.alerting.anomaly.defaults import DEFAULT_CHECKS, LEARNING, learning_of


def row(**fields: object) -> Check:
    return Check(**{"id": "hot", "title": "Hot", "kind": "threshold", "cause": "heat", **fields})  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("fields", "word"),
    [
        ({"high": math.nan}, "high must be a finite number"),
        ({"for_s": -1.0}, "must not be negative"),
        ({"low": 5.0, "high": 5.0}, "low must be below high"),
    ],
)
def test_a_row_without_sense_is_refused_by_name(fields: dict[str, float], word: str) -> None:
    with pytest.raises(ValueError, match=word):
        row(**fields)


def test_rows_are_found_by_series_and_kind_while_they_are_enabled() -> None:
    rows = (row(series="**.motor.temperature"), row(id="off", series="**", enabled=False), row(id="all", series="**"))
    table = CheckTable(rows)
    assert [table.rows[n].id for n in table.of("left.motor.temperature", "threshold")] == ["hot", "all"]
    assert table.of("left.motor.temperature", "change") == []
    assert table.get("off") is None
    assert table.named("off") is not None
    with pytest.raises(ValueError, match="same id"):
        CheckTable((row(), row()))


@pytest.mark.parametrize(
    ("series", "ids"),
    [
        ("host.cpu.percent", {"cpu"}),
        ("arm.host.memory.percent", {"memory"}),
        ("host.disk.percent", {"disk"}),
        ("host.temperature.celsius", {"host_heat", "host_heat_severe"}),
        ("battery_state.percentage", {"battery_low", "battery_empty", "battery_drain"}),
        ("battery_state.voltage", {"battery_sag"}),
        ("motor_temperature.temperature", {"motor_hot", "motor_overheats", "motor_rise"}),
        ("left.motor_temperature.temperature", {"motor_hot", "motor_overheats", "motor_rise"}),
        ("odom.twist.twist.linear.x", set()),
    ],
)
def test_the_series_of_a_robot_get_the_defaults_that_are_meant_for_them(series: str, ids: set[str]) -> None:
    table = CheckTable(DEFAULT_CHECKS)
    assert {table.rows[n].id for n in table.of(series, "threshold", "change")} == ids


def test_every_default_says_what_it_is() -> None:
    for check in DEFAULT_CHECKS:
        assert check.title
        assert check.title[0].isupper()
        assert check.cause
        if check.kind in ("threshold", "change"):
            assert (check.low is None) != (check.high is None)


@pytest.mark.parametrize(
    ("check_id", "fields"),
    [
        ("motor_hot", {"low", "high", "for_s", "clear_s"}),
        ("rate_low", {"low", "high", "for_s", "clear_s"}),
        ("offline", {"for_s", "clear_s"}),
        ("behind", {"high", "for_s", "clear_s"}),
        ("crash_loop", {"high"}),
        ("silence", set()),
        ("frozen", set()),
        ("novelty", set()),
    ],
)
def test_only_what_has_an_effect_may_be_set(check_id: str, fields: set[str]) -> None:
    check = CheckTable(DEFAULT_CHECKS).named(check_id)
    assert check is not None
    assert set(check.fields) == {"enabled", "severity", *fields}


def test_what_has_no_usual_value_is_not_learnt_and_heat_has_a_least_change() -> None:
    assert not learning_of("host.disk.percent").learnt
    assert not learning_of("odom.pose.pose.position.x").learnt
    assert learning_of("left.motor_temperature.temperature").least == 2.0
    assert learning_of("imu.angular_velocity.z").least == 0.0
    assert learning_of("imu.angular_velocity.z").learnt


def test_every_check_and_every_rule_of_learning_is_documented() -> None:
    page = (Path(__file__).resolve().parents[4] / "docs/reference/checks.md").read_text()
    assert [check.id for check in DEFAULT_CHECKS if f"| `{check.id}` | {check.title} |" not in page] == []
    assert [row.series for row in LEARNING if f"| `{row.series}` |" not in page] == []
