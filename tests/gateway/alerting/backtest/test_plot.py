"""The picture of a backtest: well-formed whatever is in it, with what fired where it did."""

from __future__ import annotations

import math
import re
from typing import Any
from xml.etree import ElementTree

import pytest

from gateway.alerting.backtest.axis import Axis, number, time_ticks, value_ticks
from gateway.alerting.backtest.plot import LEFT, MARGIN, MOST_PANELS, WIDTH, plot_svg

SVG = "{http://www.w3.org/2000/svg}"
START_MS = 1_795_000_000_000.0
HOUR_MS = 3_600_000.0
BEGIN, END = "2026-11-18T11:06:40.000Z", "2026-11-18T12:06:40.000Z"
MIDDLE, LATER = "2026-11-18T11:36:40.000Z", "2026-11-18T11:46:40.000Z"


def series(name: str = "motor.temperature", *, hole: bool = False) -> dict[str, Any]:
    """An hour of a sine with a band from its first quarter on."""
    points = []
    for place in range(240):
        if not (hole and 100 < place < 140):
            band = [-1.2, 1.2] if place >= 60 else [None, None]
            points.append([START_MS + place * HOUR_MS / 240, math.sin(place / 9), *band, 0.0])
    return {"series": name, "samples": 3600, "points": points}


def report(**changes: Any) -> dict[str, Any]:
    """A report of one series, on which one thing fired."""
    finding = {
        "detector": "level",
        "series": "motor.temperature",
        "cause": "heat",
        "severity": "error",
        "score": 0.8,
        "value": 2.0,
        "low": -1.2,
        "high": 1.2,
        "reason": "2 <is> above 1.2",
        "at": MIDDLE,
        "until": LATER,
    }
    alert = {
        "cause": "heat",
        "severity": "error",
        "title": "Too hot",
        "reason": "2 <is> above 1.2",
        "first": MIDDLE,
        "last": None,
        "findings": 1,
    }
    whole = {
        "robot": "sim_1",
        "span": {"from": BEGIN, "to": END},
        "samples": 3600,
        "findings": [finding],
        "alerts": [alert],
        "series": [series()],
        "cut": False,
        "took_s": 1.0,
    }
    return {**whole, **changes}


def drawn(document: dict[str, Any]) -> ElementTree.Element:
    """The picture, read as XML; no number in it is none."""
    text = plot_svg(document)
    assert re.search(r"\b(nan|inf)\b", re.sub(r"<(title|text).*?</\1>", "", text, flags=re.DOTALL)) is None
    return ElementTree.fromstring(text)


def of_class(root: ElementTree.Element, name: str) -> list[ElementTree.Element]:
    """Elements with that class."""
    return [item for item in root.iter() if name in item.get("class", "").split()]


def test_a_mark_lies_where_it_fired_and_says_why() -> None:
    root = drawn(report())
    (mark,) = of_class(root, "mark")
    left, right = MARGIN + LEFT, WIDTH - MARGIN - 10
    assert float(mark.get("cx", "")) == pytest.approx((left + right) / 2, abs=0.1)
    title = mark.find(f"{SVG}title")
    assert title is not None
    assert "2 <is> above 1.2" in (title.text or "")
    (bar,) = of_class(root, "bar")
    reach = float(bar.get("x", "")) + float(bar.get("width", ""))
    assert reach == pytest.approx(right, abs=0.2), "it is open at the end"
    assert of_class(root, "heading")[0].text == "sim_1: 1 alert of 1 finding would have fired"
    assert len(of_class(root, "band")) == 2, "the band itself and its key"


def test_a_hole_in_the_values_is_a_hole_in_the_line() -> None:
    assert len(of_class(drawn(report()), "line")) == 1
    assert len(of_class(drawn(report(series=[series(hole=True)])), "line")) == 2


def test_nothing_fired_and_nothing_stored() -> None:
    root = drawn(report(findings=[], alerts=[]))
    assert of_class(root, "heading")[0].text == "sim_1: nothing would have fired"
    empty = drawn(report(findings=[], alerts=[], series=[], samples=0))
    assert any("no series of that time" in (item.text or "") for item in empty.iter(f"{SVG}text"))


def test_many_series_are_cut_and_said_to_be() -> None:
    root = drawn(report(series=[series(f"a.{number}") for number in range(MOST_PANELS + 3)], cut=True))
    assert len(of_class(root, "card")) == MOST_PANELS
    texts = " ".join(item.text or "" for item in root.iter(f"{SVG}text"))
    assert "and 3 more series" in texts
    assert "cut: there was more" in texts


def test_values_as_near_as_numbers_can_be() -> None:
    points = [[START_MS + n, value, None, None, 0.0] for n, value in enumerate((0.0, 5e-324, 1e-310))]
    for some in (points[:2], points):
        assert len(of_class(drawn(report(series=[{"series": "x", "samples": 2, "points": some}])), "line")) == 1
    assert list(value_ticks(Axis(0.0, 5e-324, 100.0, 0.0))) == []


@pytest.mark.parametrize("value", [0.0, -5.0, 1e300, -1e-300, 7e15])
def test_a_constant_a_single_and_a_huge_value(value: float) -> None:
    constant = {"series": "x", "samples": 2, "points": [[START_MS + n, value, None, None, 0.0] for n in range(2)]}
    single = {"series": "y", "samples": 1, "points": [[START_MS, value, -1e305, 1e305, 0.0]]}
    assert len(of_class(drawn(report(series=[constant, single])), "line")) == 2


def test_names_from_robots_are_text() -> None:
    hostile = "</text><script>\x00\u202e"
    fired = [{**report()["findings"][0], "series": hostile, "severity": '"/><script>'}]
    root = drawn(report(robot=hostile, series=[series(hostile)], findings=fired))
    assert not list(root.iter(f"{SVG}script"))


@pytest.mark.parametrize(("begin", "end"), [(0.0, 1.0), (-3.1, 97.0), (1e-9, 3e-9), (-1e12, 1e12), (99.99, 100.01)])
def test_ticks_are_few_and_within(begin: float, end: float) -> None:
    ticks = list(value_ticks(Axis(begin, end, 100.0, 0.0)))
    assert 1 <= len(ticks) <= 8
    assert all(begin <= tick <= end for tick in ticks)
    assert list(value_ticks(Axis(1.0, 1.0, 0.0, 1.0))) == []


@pytest.mark.parametrize(
    ("span_ms", "first"), [(20e3, "11:06:40"), (3600e3, "11:10"), (86_400e3, "12:00"), (20 * 86_400e3, "11-19")]
)
def test_times_are_round(span_ms: float, first: str) -> None:
    ticks = list(time_ticks(Axis(START_MS, START_MS + span_ms, 0.0, 1000.0)))
    assert 2 <= len(ticks) <= 11
    assert ticks[0][1] == first


def test_numbers_beside_an_axis_are_short() -> None:
    assert [number(value) for value in (0.0, 0.25, 1200.0, 2.5e7, -3e-5)] == ["0", "0.25", "1200", "2.5e+07", "-3e-05"]
