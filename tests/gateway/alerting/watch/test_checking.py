"""The table of checks: what people may set, what they may not, and what is stored of it."""

from __future__ import annotations

from typing import Any

import pytest

from gateway.alerting.anomaly.defaults import DEFAULT_CHECKS
from gateway.alerting.watch.checking import Change, checked, merged, row_of
from gateway.alerting.watch.errors import UnknownCheckError
from gateway.errors import InvalidRequestError
from tests.support.tables import refusal

HOT = next(check for check in DEFAULT_CHECKS if check.id == "motor_hot")


def test_without_changes_it_is_as_it_comes() -> None:
    assert merged({}) == DEFAULT_CHECKS
    row = row_of(HOT, None)
    assert (row.id, row.high, row.changed, row.by) == ("motor_hot", HOT.high, (), "")


def test_changes_lie_over_it_and_are_named() -> None:
    (check,) = [check for check in merged({"motor_hot": {"high": 70.0, "enabled": False}}) if check.id == "motor_hot"]
    row = row_of(check, Change(values={"high": 70.0}, by="ann", at_ns=5))
    assert (row.high, row.enabled, row.changed, row.by, row.at_ns) == (70.0, False, ("enabled", "high"), "ann", 5)


def test_only_what_is_otherwise_is_kept() -> None:
    kept = checked("motor_hot", {"for_s": 3.0}, {"high": HOT.high, "severity": "error"})
    assert kept == {"for_s": 3.0, "severity": "error"}
    assert checked("motor_hot", kept, {"severity": HOT.severity, "for_s": HOT.for_s}) == {}
    assert checked("motor_hot", {}, {"high": None})["high"] is None


IMPOSSIBLE: tuple[dict[str, Any], ...] = (
    {"high": float("nan")},
    {"high": "80"},
    {"high": True},
    {"low": 100.0},  # over high
    {"for_s": -1.0},
    {"for_s": None},
    {"clear_s": 1e9},
    {"severity": "fatal"},
    {"enabled": 1},
    {"series": "**"},
)


def test_what_it_cannot_have_is_refused() -> None:
    taken = [one for one in IMPOSSIBLE if not refusal(InvalidRequestError, checked, "motor_hot", {}, one)]
    assert taken == []


def test_a_check_that_there_is_not_is_named() -> None:
    with pytest.raises(UnknownCheckError, match="no check 'nonsense'"):
        checked("nonsense", {}, {})


def test_what_was_stored_and_fits_no_more_is_left_out(caplog: pytest.LogCaptureFixture) -> None:
    assert merged({"motor_hot": {"low": 500.0}, "of another version": {"high": 1.0}}) == DEFAULT_CHECKS
    assert "motor_hot" in caplog.text
