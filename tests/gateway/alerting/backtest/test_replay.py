"""Stored rows through an evaluator of their own: what fires, when, and how a series is drawn."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gateway.alerting.anomaly.checks import Check
from gateway.alerting.anomaly.defaults import DEFAULT_CHECKS
from gateway.alerting.backtest.replay import Columns, Replay
from gateway.alerting.backtest.report import COOL_DOWN_NS, NS, Fired, grouped
from gateway.alerting.backtest.trace import SPANS, Spans, Trace
from gateway.domain.channel import Series
from gateway.domain.finding import Finding, FindingSeverity

START_NS = 1_790_000_000 * NS
MOTOR = Series("motor_left.temperature", "/sim_1/motor_left", "temperature")
HOT = tuple(check for check in DEFAULT_CHECKS if check.id == "motor_hot")
SECONDS = 120


def heating(peak: float) -> Columns:
    """A motor at 40 °C that is hot for 30 s of its two minutes."""
    values = np.full(SECONDS, 40.0)
    values[50:80] = peak
    stamps = START_NS + np.arange(SECONDS, dtype=np.int64) * NS
    return Columns(MOTOR.name, stamps, values + np.sin(np.arange(SECONDS)) * 0.5)


def replayed(columns: Columns, checks: tuple[Check, ...], *, piece_s: int) -> Replay:
    """All of it, cut into pieces of that length."""
    end_ns = START_NS + SECONDS * NS
    replay = Replay("sim_1", [MOTOR], start_ns=START_NS, end_ns=end_ns, checks=checks)
    for at_ns in range(START_NS, end_ns, piece_s * NS):
        until_ns = min(end_ns, at_ns + piece_s * NS)
        inside = (columns.stamps_ns >= at_ns) & (columns.stamps_ns < until_ns)
        piece = Columns(columns.series, columns.stamps_ns[inside], columns.values[inside])
        replay.feed([piece] if len(piece.values) else [], from_ns=at_ns, until_ns=until_ns)
    return replay


def test_what_fires_does_not_depend_on_how_history_is_cut() -> None:
    found = {piece_s: replayed(heating(90.0), HOT, piece_s=piece_s).fired() for piece_s in (1, 7, SECONDS)}
    (fired,) = found[SECONDS]
    assert (fired.finding.kind, fired.finding.series, fired.finding.cause) == ("motor_hot", MOTOR.name, "heat")
    assert 50 <= (fired.opened_ns - START_NS) / NS <= 60
    assert fired.cleared_ns > fired.opened_ns
    assert found == dict.fromkeys(found, (fired,))


def test_a_check_that_was_changed_fires_otherwise() -> None:
    assert replayed(heating(70.0), HOT, piece_s=60).fired() == ()
    lower = tuple(replace(check, high=60.0) for check in HOT)
    (fired,) = replayed(heating(70.0), lower, piece_s=60).fired()
    assert "60" in fired.finding.reason


def test_a_series_is_drawn_with_its_extremes_and_where_it_fired() -> None:
    (series,) = replayed(heating(90.0), HOT, piece_s=20).series()
    assert (series.series, series.samples) == (MOTOR.name, SECONDS)
    values = [point[1] for point in series.points]
    assert max(values) == heating(90.0).values.max()
    assert min(values) == heating(90.0).values.min()
    assert max(point[4] for point in series.points) >= 0.5
    assert series.points[0][2:4] == (None, None), "nothing is expected before anything was seen"
    low, high = series.points[-1][2:4]
    assert low is not None
    assert high is not None
    assert low < 40.0 < high


def test_a_trace_keeps_few_points_of_many_rows_and_nothing_that_is_no_number() -> None:
    spans = Spans(0, 10**12)
    trace = Trace(spans)
    values = np.sin(np.arange(100_000) / 500)
    values[5], values[6], values[7] = np.nan, np.inf, 1.79e308
    for piece in np.array_split(np.arange(100_000), 7):
        trace.add(piece * 10**7, values[piece])
    trace.expect(3, -1.0, 1.0)
    trace.mark(3 * spans.width_ns, 0.7)
    trace.mark(3 * spans.width_ns + 1, 0.4)
    points = trace.points()
    assert trace.samples == 100_000
    assert len(points) <= 4 * SPANS
    assert all(abs(point[1]) <= 1.0 for point in points)
    banded = [point for point in points if point[2] is not None]
    assert {point[2:] for point in banded} == {(-1.0, 1.0, 0.7)}
    assert {spans.of(point[0]) for point in banded} == {3}


def fired(cause: str, from_s: int, to_s: int, severity: FindingSeverity = "warning") -> Fired:
    """A finding of that cause; `to_s` 0: open at the end."""
    finding = Finding(
        robot="r1",
        series=f"{cause}.x",
        kind="level",
        cause=cause,
        severity=severity,
        score=0.6,
        value=1.0,
        low=0.0,
        high=0.5,
        reason=f"{cause} at {from_s}",
        since_s=float(from_s),
    )
    return Fired(finding, from_s * NS, to_s * NS)


def test_findings_of_one_cause_are_one_alert_until_it_was_quiet_for_long() -> None:
    cool_s = COOL_DOWN_NS // NS
    alerts = grouped(
        [
            fired("heat", 10, 20),
            fired("change", 15, 0),
            fired("heat", 30, 40, "error"),
            fired("heat", 41 + cool_s, 60 + cool_s),
            fired("change", 5000, 5001),
        ]
    )
    reported = [(one.cause, one.severity, one.first_ns // NS, one.last_ns // NS, one.findings) for one in alerts]
    assert reported == [
        ("heat", "error", 10, 40, 2),
        ("change", "warning", 15, 0, 2),
        ("heat", "warning", 41 + cool_s, 60 + cool_s, 1),
    ]
    assert alerts[0].reason == "heat at 30"
