"""Alerts in both databases: kept over a revision, one unresolved of a kind, found again, deleted when old."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import isnan, nan
from typing import Any

import pytest

from gateway.domain.alert import Alert, AlertFilter, Evidence, Remark
from gateway.errors import TooManyError
from gateway.store.alerting.alerts import (
    alert_revisions,
    find_unresolved,
    list_alerts,
    live_alerts,
    purge_alerts,
    read_alert,
    read_alerts,
    save_alert,
)
from gateway.store.alerting.remarks import (
    add_remark,
    add_silence,
    current_silences,
    end_silence,
    list_remarks,
    read_silence,
)
from gateway.store.engine import StoreEngine
from tests.gateway.alerting.alerts.findings import NOW, S, finding, silence


def alert(number: int = 1, **more: Any) -> Alert:
    """An open alert, a second later for each number."""
    at_ns = NOW + number * S
    fields: dict[str, Any] = {
        "id": f"{number:026}",
        "robot": "r1",
        "cause": "heat",
        "state": "open",
        "severity": "warning",
        "title": "Too hot",
        "opened_ns": at_ns,
        "first_ns": at_ns,
        "changed_ns": at_ns,
        "seen_ns": at_ns,
    }
    return Alert(**{**fields, **more})


def resolved(number: int, **more: Any) -> Alert:
    """One that is over, and all of it."""
    at_ns = NOW + number * S
    return alert(number, **{"state": "resolved", "resolved_ns": at_ns + S // 2, "clear_ns": at_ns, **more})


def keep(engine: StoreEngine, *alerts: Alert) -> list[bool]:
    """Save alerts, each by itself."""
    done = []
    for item in alerts:
        with engine.transaction(write=True):
            done.append(save_alert(engine, item))
    return done


def test_an_alert_comes_back_as_it_was_kept(engine: StoreEngine) -> None:
    evidence = (
        Evidence(finding=finding(value=nan, reason="a “hot” motor\nnow"), told_ns=NOW),
        Evidence(finding=finding(series="b"), told_ns=NOW, ended_ns=NOW + 1),
    )
    kept = alert(
        findings=evidence, value=91.5, low=None, times=3, clip="C", assignee="bob", silence="S", gateway="g1", title="ü"
    )
    assert keep(engine, kept) == [True]
    with engine.transaction(write=False):
        found = read_alert(engine, kept.id)
        assert read_alert(engine, "1" * 26) is None
    assert found is not None
    assert isnan(found.findings[0].finding.value)
    first = replace(evidence[0], finding=replace(found.findings[0].finding, value=0.0))
    assert first == replace(evidence[0], finding=replace(evidence[0].finding, value=0.0))
    assert replace(found, findings=evidence, revision=0) == kept
    assert found.findings[1] == evidence[1]
    assert found.revision == 1


def test_a_change_is_kept_over_the_revision_that_was_read_only(engine: StoreEngine) -> None:
    assert keep(engine, alert(), alert()) == [True, False]
    first = alert(revision=1, assignee="eve")
    assert keep(engine, first, first, alert(revision=2, assignee="bob")) == [True, False, True]
    with engine.transaction(write=False):
        assert [(item.assignee, item.revision) for item in list_alerts(engine, limit=9)] == [("bob", 3)]


def test_a_robot_has_one_unresolved_alert_of_a_cause(engine: StoreEngine) -> None:
    over = resolved(0)
    assert keep(engine, over, alert(1), alert(2), alert(3, robot="r2"), alert(4, cause="battery")) == [
        True,
        True,
        False,
        True,
        True,
    ]
    assert keep(engine, replace(over, state="open", resolved_ns=0, revision=1)) == [False]
    with engine.transaction(write=False):
        found = find_unresolved(engine, "r1", "heat")
        assert find_unresolved(engine, "r3", "heat") is None
    assert found is not None
    assert found.id == alert(1).id
    assert keep(engine, resolved(1, revision=1), replace(over, state="open", resolved_ns=0, revision=1)) == [True, True]


def test_two_gateways_that_open_it_at_once_have_one(connect: Callable[[], StoreEngine]) -> None:
    first, second = connect(), connect()
    assert keep(first, alert(1)) + keep(second, alert(2)) == [True, False]


def test_what_can_still_change_by_itself_is_found(engine: StoreEngine) -> None:
    keep(
        engine,
        resolved(1),
        resolved(2, clear_ns=0),
        alert(3),
        resolved(4, cause="battery"),
        alert(5, cause="battery"),
    )
    with engine.transaction(write=False):
        found = live_alerts(engine, resolved_after_ns=NOW + 4 * S, limit=9)
        assert [item.id[-1] for item in found] == ["2", "3", "4", "5"]
        assert [item.id[-1] for item in live_alerts(engine, resolved_after_ns=NOW + 9 * S, limit=1)] == ["5"]
        assert {key[-1]: number for key, number in alert_revisions(engine).items()} == {"2": 1, "3": 1, "5": 1}
        some = [alert(3).id, alert(1).id, "x"]
        assert sorted(item.id[-1] for item in read_alerts(engine, some)) == ["1", "3"]
        assert read_alerts(engine, []) == []


@pytest.mark.parametrize(
    ("wanted", "expected"),
    [
        (AlertFilter(), "654321"),
        (AlertFilter(states=("resolved",)), "21"),
        (AlertFilter(states=("open", "acknowledged")), "6543"),
        (AlertFilter(severities=("error",)), "5"),
        (AlertFilter(robots=("r2", "r3")), "6"),
        (AlertFilter(causes=("bat*", "offline")), "54"),
        (AlertFilter(text="PERCENT"), "4"),
        (AlertFilter(text="r2"), "6"),
        (AlertFilter(quiet=True), "5"),
        (AlertFilter(quiet=False, causes=("battery",)), "4"),
        (AlertFilter(from_ns=NOW + 2 * S), "65432"),
        (AlertFilter(until_ns=NOW + 3 * S), "21"),
        (AlertFilter(sees=lambda robot: robot == "r2"), "6"),
        (AlertFilter(states=("open",), text="nothing"), ""),
    ],
)
def test_what_somebody_wants_is_found_the_newest_first(engine: StoreEngine, wanted: AlertFilter, expected: str) -> None:
    kept = [
        resolved(1),
        resolved(2),
        alert(3, state="acknowledged"),
        alert(4, cause="battery", reason="12 percent"),
        alert(5, cause="offline", severity="error", silence="S"),
        alert(6, robot="r2"),
    ]
    assert all(keep(engine, *kept))
    with engine.transaction(write=False):
        found = list_alerts(engine, wanted, limit=9)
        assert "".join(item.id[-1] for item in found) == expected
        first = list_alerts(engine, wanted, limit=1)
        rest = list_alerts(engine, wanted, limit=9, before=first[-1].id) if first else []
    assert [*first, *rest] == found
    assert all(wanted.matches(item) for item in found)


def test_a_page_of_what_is_rare_looks_as_far_as_it_must(engine: StoreEngine) -> None:
    rare = resolved(1, robot="r7")
    with engine.transaction(write=True):
        assert save_alert(engine, rare)
        for number in range(2, 1200):
            assert save_alert(engine, resolved(number))
    with engine.transaction(write=False):
        found = list_alerts(engine, AlertFilter(sees=lambda robot: robot == "r7"), limit=5)
    assert [item.id for item in found] == [rare.id]


def test_what_is_over_for_long_goes_with_all_that_belongs_to_it(engine: StoreEngine) -> None:
    keep(engine, *(resolved(number) for number in range(1, 7)), resolved(7, clear_ns=0), alert(8))
    with engine.transaction(write=True):
        add_remark(engine, Remark(alert=alert(1).id, number=0, at_ns=NOW, by="eve", kind="comment"), most=9)
        assert purge_alerts(engine, before_ns=NOW + 2 * S, most=99) == 1
        assert purge_alerts(engine, before_ns=0, most=3) == 2
        assert purge_alerts(engine, before_ns=NOW + 99 * S, most=3, limit=2) == 2
        assert purge_alerts(engine, before_ns=NOW + 99 * S, most=3) == 1
        assert purge_alerts(engine, before_ns=NOW + 99 * S, most=3) == 0
        assert [item.id[-1] for item in list_alerts(engine, limit=9)] == ["8", "7"]
        assert list_remarks(engine, alert(1).id) == []


def test_remarks_are_numbered_and_bounded(engine: StoreEngine) -> None:
    keep(engine, alert())
    with engine.transaction(write=True):
        for text in ("one", "two"):
            add_remark(engine, Remark(alert=alert().id, number=0, at_ns=NOW, by="e", kind="comment", text=text), most=2)
        with pytest.raises(TooManyError):
            add_remark(engine, Remark(alert=alert().id, number=0, at_ns=NOW, by="e", kind="comment"), most=2)
        assert [(item.number, item.text) for item in list_remarks(engine, alert().id)] == [(1, "one"), (2, "two")]


def test_silences_are_kept_until_they_are_over_and_a_while_longer(engine: StoreEngine) -> None:
    one = silence(id="A", robots=("r*",), causes=("heat",), up_to="warning", reason="moving house")
    two = silence(id="B", until_ns=NOW + 60 * S)
    with engine.transaction(write=True):
        for item in (one, two):
            add_silence(engine, item, most=2, now_ns=NOW, kept_ns=100 * S)
        with pytest.raises(TooManyError):
            add_silence(engine, silence(id="C"), most=2, now_ns=NOW, kept_ns=100 * S)
        assert current_silences(engine, now_ns=NOW) == [two, one]
        end_silence(engine, "B", now_ns=NOW + S)
        end_silence(engine, "B", now_ns=NOW + 2 * S)
        assert current_silences(engine, now_ns=NOW + S) == [one]
        assert read_silence(engine, "B") == replace(two, until_ns=NOW + S)
        add_silence(engine, silence(id="C"), most=2, now_ns=NOW + 102 * S, kept_ns=100 * S)
        assert read_silence(engine, "B") is None
