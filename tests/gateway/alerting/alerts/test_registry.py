"""The book: when an alert opens, groups, gets worse, resolves, comes back, and keeps quiet."""

from __future__ import annotations

from dataclasses import replace
from math import inf, nan
from typing import Any

from gateway.alerts.book import Book
from gateway.alerts.config import AlertConfig
from gateway.domain.alert import Alert
from metaros.limits import LIMITS
from tests.gateway.alerts.findings import NOW, S, cleared, edge, only, opened, silence, stored


def make(**more: Any) -> Book:
    """An empty book; small limits where they are named."""
    limits = {key: more.pop(key) for key in list(more) if hasattr(LIMITS, key)}
    return Book(gateway="g1", limits=replace(LIMITS, **limits), **more)


def news(book: Book, now_ns: int = NOW) -> list[str]:
    """What is told once all is stored."""
    return [what for _, told in stored(book, now_ns) for what in told if what != "seen"]


def test_a_finding_opens_an_alert_that_says_what_and_why() -> None:
    book = make()
    book.apply([opened()], NOW)
    alert = only(book)
    assert (alert.robot, alert.cause, alert.state, alert.severity) == ("r1", "heat", "open", "warning")
    assert (alert.title, alert.series, alert.detector) == ("Too hot", "motor.temperature", "limit")
    assert (alert.value, alert.low, alert.high, alert.score) == (91.0, 20.0, 80.0, 0.8)
    assert (alert.opened_ns, alert.first_ns, alert.clear_ns, alert.gateway) == (NOW, NOW, 0, "g1")
    assert news(book) == ["opened"]
    assert only(book).revision == 1


def test_findings_of_one_cause_are_one_alert_that_shows_the_worst() -> None:
    book = make()
    book.apply([opened(), opened(series="arm.temperature", severity="error", reason="worse")], NOW)
    book.apply([opened(series="cpu.temperature", score=0.6)], NOW + S)
    alert = only(book)
    assert (alert.severity, alert.reason, alert.series) == ("error", "worse", "arm.temperature")
    assert [item.finding.series for item in alert.findings] == [
        "arm.temperature",
        "motor.temperature",
        "cpu.temperature",
    ]


def test_severity_escalates_and_never_drops_while_it_is_open() -> None:
    book = make()
    book.apply([opened()], NOW)
    assert news(book) == ["opened"]
    book.apply([edge("changed", severity="error")], NOW + S)
    assert news(book) == ["escalated"]
    book.apply([edge("changed", severity="info")], NOW + 2 * S)
    assert only(book).severity == "error"
    assert news(book) == []


def test_it_resolves_by_itself_when_all_findings_were_over_for_long_enough() -> None:
    book = make()
    book.apply([opened(), opened(series="b")], NOW)
    book.apply([cleared()], NOW + S)
    book.tick(NOW + 100 * S)
    assert only(book).clear_ns == 0
    book.apply([cleared(series="b")], NOW + 100 * S)
    book.tick(NOW + 129 * S)
    assert only(book).clear_ns == NOW + 100 * S
    book.tick(NOW + 130 * S)
    assert book.of("r1") == ()
    (alert, told), *_ = stored(book)
    assert told[-1] == "resolved"
    assert (alert.state, alert.resolved_by, alert.resolved_ns) == ("resolved", "", NOW + 130 * S)
    assert all(not item.active for item in alert.findings)


def test_what_flaps_is_one_alert_that_counts() -> None:
    book = make()
    for again in range(5):
        book.apply([opened()], NOW + 2 * again * S)
        book.apply([cleared()], NOW + (2 * again + 1) * S)
    assert only(book).times == 5
    assert news(book) == ["opened"]
    book.apply([opened()], NOW + 20 * S)
    assert news(book) == ["changed"]


def test_within_the_cool_down_the_same_alert_begins_again_and_after_it_a_new_one() -> None:
    book = make()
    book.apply([opened()], NOW)
    first = only(book).id
    book.apply([cleared()], NOW + S)
    book.tick(NOW + 31 * S)
    stored(book)
    book.apply([opened()], NOW + 600 * S)
    again = only(book)
    assert (again.id, again.times, again.state, again.resolved_ns) == (first, 2, "open", 0)
    assert news(book) == ["opened"]
    book.apply([cleared()], NOW + 601 * S)
    book.tick(NOW + 700 * S)
    stored(book)
    book.tick(NOW + 1400 * S)
    book.apply([opened()], NOW + 1400 * S)
    assert only(book).id != first


def test_what_somebody_resolved_while_it_goes_on_stays_resolved_until_it_is_news() -> None:
    book = make()
    book.apply([opened()], NOW)
    stored(book)
    closed = replace(only(book), state="resolved", resolved_ns=NOW + S, resolved_by="eve", revision=2)
    book.learn(closed, NOW + S)
    book.apply([opened(), edge("changed")], NOW + 2 * S)
    assert book.of("r1") == ()
    assert news(book) == []
    book.tick(NOW + 5000 * S)  # it is held as long as its finding is not over
    book.apply([edge("changed")], NOW + 5000 * S)
    assert book.of("r1") == ()
    book.apply([edge("changed", severity="error")], NOW + 5001 * S)
    assert (only(book).id, only(book).severity, only(book).times) == (closed.id, "error", 2)


def test_the_end_of_what_somebody_resolved_is_stored_and_the_next_beginning_is_a_new_alert() -> None:
    book = make()
    book.apply([opened()], NOW)
    stored(book)
    closed = replace(only(book), state="resolved", resolved_ns=NOW + S, resolved_by="eve", revision=2)
    book.learn(closed, NOW + S)
    book.apply([cleared()], NOW + 1000 * S)
    ((alert, told),) = stored(book)
    assert (alert.state, alert.clear_ns, told) == ("resolved", NOW + 1000 * S, ("seen",))
    book.apply([opened()], NOW + 2000 * S)
    assert only(book).id != closed.id


def test_a_robot_that_is_offline_is_told_once() -> None:
    book = make()
    book.apply([opened(cause="silence", severity="error"), opened(cause="offline", series="")], NOW)
    offline, silent = sorted(book.of("r1"), key=lambda alert: alert.cause)
    assert silent.inhibited_by == offline.id
    assert (silent.quiet, offline.quiet) == (True, False)
    book.apply([cleared(cause="offline", series="")], NOW + S)
    book.tick(NOW + 31 * S)
    assert not only(book).quiet


def test_a_crashed_node_explains_the_topics_that_it_publishes() -> None:
    book = make(topics_of=lambda robot, node: {"/scan"} if (robot, node) == ("r1", "lidar") else set())
    book.apply([opened(cause="crash", series="lidar", severity="error")], NOW)
    book.apply([opened(cause="silence", series="/scan"), opened(cause="rate", series="/odom")], NOW)
    quiet = {alert.cause: alert.quiet for alert in book.of("r1")}
    assert quiet == {"crash": False, "silence": True, "rate": False}
    book.apply([opened(cause="silence", series="/image")], NOW)
    assert not {alert.cause: alert.quiet for alert in book.of("r1")}["silence"]


def test_nothing_but_offline_explains_what_is_worse_than_itself() -> None:
    book = make()
    book.apply([opened(cause="host", series="cpu"), opened(cause="rate", series="/scan", severity="error")], NOW)
    assert [alert.quiet for alert in book.of("r1")] == [False, False]


def test_silences_begin_and_end_and_let_through_what_is_worse() -> None:
    book = make()
    book.silence([silence(robots=("r*",), causes=("heat",), up_to="warning", from_ns=NOW + 10 * S)], NOW)
    book.apply([opened()], NOW)
    assert only(book).silence == ""
    assert news(book) == ["opened"]
    book.tick(NOW + 10 * S)
    assert only(book).silence == "S1"
    assert news(book) == ["changed"]
    book.apply([edge("changed", severity="error")], NOW + 11 * S)
    assert only(book).silence == ""
    book.apply([opened("r2"), opened("x1")], NOW + 12 * S)
    assert (only(book, "r2").silence, only(book, "x1").silence) == ("S1", "")
    book.tick(NOW + 3600 * S)
    assert only(book, "r2").silence == ""


def test_there_is_a_cap_per_robot_and_what_waits_is_said_once_and_not_lost() -> None:
    book = make(alerts_per_robot=2)
    book.apply([opened(cause=f"c{number}") for number in range(5)], NOW)
    book.tick(NOW + S)
    causes = {alert.cause: alert for alert in book.of("r1")}
    assert set(causes) == {"c0", "c1", "too_many"}
    assert causes["too_many"].value == 3.0
    book.apply([cleared(cause="c0"), cleared(cause="c2")], NOW + 2 * S)
    book.tick(NOW + 40 * S)
    assert {alert.cause for alert in book.of("r1")} == {"c1", "c3", "too_many"}
    book.apply([cleared(cause="c1"), cleared(cause="c4")], NOW + 41 * S)
    book.tick(NOW + 80 * S)
    book.tick(NOW + 111 * S)
    assert {alert.cause for alert in book.of("r1")} == {"c3"}


def test_there_is_a_cap_for_the_fleet_and_one_alert_instead_of_a_storm() -> None:
    book = make(alerts_unresolved=3, alert_findings_waiting=4)
    book.apply([opened(f"r{number}") for number in range(10)], NOW)
    book.tick(NOW + S)
    assert book.unresolved == 3
    assert book.refused == 3
    assert only(book, "").reason == "4 findings wait for room: the fleet has as many alerts as can be"
    assert len(news(book)) == 4


def test_what_is_not_told_again_after_a_restart_is_over_after_the_grace() -> None:
    before = make()
    before.apply([opened(), opened(series="b"), opened(cause="battery")], NOW)
    found = [replace(alert, revision=1) for alert, _ in stored(before)]
    book = make()
    for alert in found:
        book.learn(alert, NOW)
    book.adopt("r1", NOW)
    book.apply([opened(series="b")], NOW + S)
    assert news(book, NOW + S) == []  # known already
    book.tick(NOW + 120 * S)
    heat, battery = sorted(book.of("r1"), key=lambda alert: alert.cause, reverse=True)
    assert [item.finding.series for item in heat.findings if item.active] == ["b"]
    assert (heat.clear_ns, battery.clear_ns) == (0, NOW + 120 * S)
    book.tick(NOW + 150 * S)
    assert only(book).cause == "heat"


def test_what_a_rule_told_needs_no_telling_again() -> None:
    book = make()
    book.apply([opened(kind="rule:hot", cause="rule:hot")], NOW)
    stored(book)
    book.adopt("r1", NOW)
    book.tick(NOW + 3600 * S)
    assert (only(book).state, only(book).clear_ns) == ("open", 0)


def test_numbers_that_are_none_show_as_none() -> None:
    book = make()
    book.apply([opened(value=nan, low=-inf, high=inf, since_s=nan)], NOW)
    book.apply([opened("r2", since_s=1e300)], NOW)
    alert = only(book)
    assert (alert.value, alert.low, alert.high) == (None, None, None)
    assert (alert.first_ns, only(book, "r2").first_ns) == (NOW, NOW)


def test_new_values_are_stored_now_and_then_only() -> None:
    book = make(config=AlertConfig(settle_s=5.0))
    book.apply([opened()], NOW)
    assert [change.news for change in book.changes(NOW, most=9)] == [("opened",)]
    for tick in range(1, 10):
        book.apply([edge("changed", value=91.0 + tick)], NOW + tick * S)
        assert bool(book.changes(NOW + tick * S, most=9)) == (tick == 5)


def test_a_calendar_that_is_set_back_or_far_ahead_makes_no_storm() -> None:
    book = make()
    book.apply([opened(), opened(series="b")], NOW)
    book.apply([cleared()], NOW - 10**6 * S)
    book.apply([cleared(series="b")], NOW + 3 * 10**8 * S)  # ten years
    book.tick(NOW)
    assert only(book).clear_ns == NOW
    book.tick(NOW + 30 * S)
    assert news(book) == ["opened", "resolved"]


def known(book: Book, **more: Any) -> Alert:
    """The robot's alert as the store would have it after somebody else's change."""
    alert = only(book)
    return replace(alert, revision=alert.revision + 1, **more)


def test_what_people_did_elsewhere_and_what_was_found_here_are_both_kept() -> None:
    book = make()
    book.apply([opened()], NOW)
    stored(book)
    elsewhere = known(book, state="acknowledged", acknowledged_ns=NOW + S, acknowledged_by="eve", assignee="bob")
    book.apply([edge("changed", severity="error")], NOW + S)
    (change,) = book.changes(NOW + S, most=9)
    book.clashed(change, elsewhere, NOW + 2 * S)
    alert = only(book)
    assert (alert.state, alert.acknowledged_by, alert.assignee) == ("acknowledged", "eve", "bob")
    assert (alert.severity, alert.revision) == ("error", 2)
    assert news(book) == ["escalated"]


def test_what_began_after_somebody_resolved_it_elsewhere_is_not_lost() -> None:
    book = make()
    book.apply([opened()], NOW)
    stored(book)
    elsewhere = known(book, state="resolved", resolved_ns=NOW + S, resolved_by="eve")
    book.apply([opened(series="b")], NOW + 2 * S)
    (change,) = book.changes(NOW + 2 * S, most=9)
    book.clashed(change, elsewhere, NOW + 3 * S)
    assert (only(book).state, only(book).times, only(book).revision) == ("open", 2, 2)


def test_an_alert_that_another_gateway_opened_first_is_the_one() -> None:
    book = make()
    book.apply([opened()], NOW)
    (change,) = book.changes(NOW, most=9)
    theirs = replace(change.alert, id="0" * 26, gateway="g2", revision=4, opened_ns=NOW - 5 * S)
    book.clashed(change, theirs, NOW)
    assert (only(book).id, only(book).revision, only(book).opened_ns) == ("0" * 26, 4, NOW - 5 * S)
    assert news(book) == ["changed"]  # that it opened was told there


def test_an_alert_that_was_deleted_is_stored_again() -> None:
    book = make()
    book.apply([opened()], NOW)
    stored(book)
    book.apply([edge("changed", severity="error")], NOW)
    (change,) = book.changes(NOW, most=9)
    book.clashed(change, None, NOW)
    ((alert, told),) = stored(book)
    assert (alert.revision, told) == (0, ("escalated",))


def elsewhere_opened(book: Book, **more: Any) -> Alert:
    """The next alert of the same cause, which another gateway opened of a series of its own: "b"."""
    other = make()
    other.apply([opened(series="b", **more)], NOW)
    return replace(only(other), id="0" * 26, gateway="g2", revision=3)


def resolved_while_it_goes_on() -> Book:
    """A book whose alert somebody resolved, and whose finding is not over."""
    book = make()
    book.apply([opened()], NOW)
    stored(book)
    book.learn(known(book, state="resolved", resolved_ns=NOW + S, resolved_by="eve"), NOW + S)
    assert book.of("r1") == ()
    return book


def test_what_goes_on_belongs_to_the_alert_that_another_gateway_opened_next() -> None:
    book = resolved_while_it_goes_on()
    book.learn(elsewhere_opened(book), NOW + 2 * S)
    assert (only(book).id, book.unresolved) == ("0" * 26, 1)
    book.apply([cleared(series="b")], NOW + 3 * S)
    assert only(book).clear_ns == 0
    book.apply([cleared()], NOW + 4 * S)
    assert only(book).clear_ns == NOW + 4 * S


def test_of_an_alert_that_another_gateway_opened_next_only_what_was_told_here_is_sure() -> None:
    for told_again, left in ((True, ["motor.temperature"]), (False, [])):
        book = resolved_while_it_goes_on()
        book.adopt("r1", NOW + S)
        if told_again:
            book.apply([opened()], NOW + 2 * S)
        stored(book)
        theirs = elsewhere_opened(book)
        mine = replace(theirs.findings[0], finding=opened().finding)
        book.learn(replace(theirs, findings=(*theirs.findings, mine)), NOW + 3 * S)
        book.tick(NOW + 200 * S)  # the grace is over
        alert = only(book)
        assert [item.finding.series for item in alert.findings if item.active] == left
        assert (alert.id, alert.clear_ns == 0) == ("0" * 26, told_again)


def test_what_another_gateway_stored_of_a_robot_that_is_taken_over_is_in_doubt() -> None:
    book = make()
    book.apply([opened()], NOW)
    stored(book)
    book.adopt("r1", NOW)
    book.apply([opened()], NOW)
    stored(book)
    theirs = known(book, gateway="g2", severity="error")
    book.learn(theirs, NOW + S)
    assert (only(book).severity, only(book).gateway) == ("error", "g1")
    book.tick(NOW + 120 * S)
    assert only(book).clear_ns == NOW + 120 * S
