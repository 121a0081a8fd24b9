"""Findings open with the first that tells them and clear with the last."""

from __future__ import annotations

import math

from gateway.alerting.anomaly.open_findings import OpenFindings
from gateway.domain.finding import Finding


def finding(robot: str = "r", series: str = "s", kind: str = "level") -> Finding:
    return Finding(
        robot=robot, series=series, kind=kind, cause="change", severity="warning", score=0.7, value=2.0, low=0.0,
        high=math.nan, reason="why", since_s=1.0,
    )  # fmt: skip


def test_two_that_tell_the_same_are_one_finding() -> None:
    opened = OpenFindings()
    opened.open(finding(), "fast", at_s=1.0)
    opened.open(finding(), "slow", at_s=2.0)
    opened.close(finding().key, "fast", at_s=3.0)
    opened.close(finding().key, "nobody", at_s=3.0)
    assert [edge.change for edge in opened.take()] == ["opened"]
    opened.close(finding().key, "slow", at_s=4.0)
    (edge,) = opened.take()
    assert (edge.change, edge.at_s) == ("cleared", 4.0)
    assert opened.all() == []


def test_kinds_of_a_series_can_be_cleared_and_a_robot_forgotten() -> None:
    opened = OpenFindings()
    for robot, series in (("r", "s"), ("r", "t"), ("q", "s")):
        opened.open(finding(robot, series), "x", at_s=1.0)
    opened.take()
    opened.clear("r", ["level"], series="s", at_s=2.0)
    assert [edge.finding.series for edge in opened.take()] == ["s"]
    opened.forget("r")
    assert [found.robot for found in opened.all()] == ["q"]
    assert opened.take() == []


def test_what_is_open_outlives_a_snapshot() -> None:
    opened, again = OpenFindings(), OpenFindings()
    opened.open(finding(), "x", at_s=1.0)
    again.load(opened.dump())
    assert repr(again.all()) == repr(opened.all())
