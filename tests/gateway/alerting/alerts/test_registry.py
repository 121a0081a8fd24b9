"""The registry: when an alert opens, groups, gets worse, resolves, comes back, and keeps quiet."""

from __future__ import annotations

from dataclasses import replace
from math import inf, nan
from typing import Any

from gateway.alerting.alerts.config import AlertConfig
from gateway.alerting.alerts.registry import AlertRegistry
from gateway.domain.alert import Alert
from metaros.limits import LIMITS
from tests.gateway.alerting.alerts.findings import NOW, S, cleared, edge, only, opened, silence, stored


def make(**more: Any) -> AlertRegistry:
    """An empty book; small limits where they are named."""
    limits = {key: more.pop(key) for key in list(more) if hasattr(LIMITS, key)}
    return AlertRegistry(gateway="g1", limits=replace(LIMITS, **limits), **more)


def news(registry: AlertRegistry, now_ns: int = NOW) -> list[str]:
    """What is told once all is stored."""
    return [what for _, reported in stored(registry, now_ns) for what in reported if what != "seen"]


def test_a_finding_opens_an_alert_that_says_what_and_why() -> None:
    registry = make()
    registry.apply([opened()], NOW)
    alert = only(registry)
    assert (alert.robot, alert.cause, alert.state, alert.severity) == ("r1", "heat", "open", "warning")
    assert (alert.title, alert.series, alert.detector) == ("Too hot", "motor.temperature", "limit")
    assert (alert.value, alert.low, alert.high, alert.score) == (91.0, 20.0, 80.0, 0.8)
    assert (alert.opened_ns, alert.first_ns, alert.clear_ns, alert.gateway) == (NOW, NOW, 0, "g1")
    assert news(registry) == ["opened"]
    assert only(registry).revision == 1


def test_findings_of_one_cause_are_one_alert_that_shows_the_worst() -> None:
    registry = make()
    registry.apply([opened(), opened(series="arm.temperature", severity="error", reason="worse")], NOW)
    registry.apply([opened(series="cpu.temperature", score=0.6)], NOW + S)
    alert = only(registry)
    assert (alert.severity, alert.reason, alert.series) == ("error", "worse", "arm.temperature")
    assert [item.finding.series for item in alert.findings] == [
        "arm.temperature",
        "motor.temperature",
        "cpu.temperature",
    ]


def test_severity_escalates_and_never_drops_while_it_is_open() -> None:
    registry = make()
    registry.apply([opened()], NOW)
    assert news(registry) == ["opened"]
    registry.apply([edge("changed", severity="error")], NOW + S)
    assert news(registry) == ["escalated"]
    registry.apply([edge("changed", severity="info")], NOW + 2 * S)
    assert only(registry).severity == "error"
    assert news(registry) == []


def test_it_resolves_by_itself_when_all_findings_were_over_for_long_enough() -> None:
    registry = make()
    registry.apply([opened(), opened(series="b")], NOW)
    registry.apply([cleared()], NOW + S)
    registry.tick(NOW + 100 * S)
    assert only(registry).clear_ns == 0
    registry.apply([cleared(series="b")], NOW + 100 * S)
    registry.tick(NOW + 129 * S)
    assert only(registry).clear_ns == NOW + 100 * S
    registry.tick(NOW + 130 * S)
    assert registry.of("r1") == ()
    (alert, reported), *_ = stored(registry)
    assert reported[-1] == "resolved"
    assert (alert.state, alert.resolved_by, alert.resolved_ns) == ("resolved", "", NOW + 130 * S)
    assert all(not item.active for item in alert.findings)


def test_what_flaps_is_one_alert_that_counts() -> None:
    registry = make()
    for again in range(5):
        registry.apply([opened()], NOW + 2 * again * S)
        registry.apply([cleared()], NOW + (2 * again + 1) * S)
    assert only(registry).times == 5
    assert news(registry) == ["opened"]
    registry.apply([opened()], NOW + 20 * S)
    assert news(registry) == ["changed"]


def test_within_the_cool_down_the_same_alert_begins_again_and_after_it_a_new_one() -> None:
    registry = make()
    registry.apply([opened()], NOW)
    first = only(registry).id
    registry.apply([cleared()], NOW + S)
    registry.tick(NOW + 31 * S)
    stored(registry)
    registry.apply([opened()], NOW + 600 * S)
    again = only(registry)
    assert (again.id, again.times, again.state, again.resolved_ns) == (first, 2, "open", 0)
    assert news(registry) == ["opened"]
    registry.apply([cleared()], NOW + 601 * S)
    registry.tick(NOW + 700 * S)
    stored(registry)
    registry.tick(NOW + 1400 * S)
    registry.apply([opened()], NOW + 1400 * S)
    assert only(registry).id != first


def test_what_somebody_resolved_while_it_goes_on_stays_resolved_until_it_is_news() -> None:
    registry = make()
    registry.apply([opened()], NOW)
    stored(registry)
    closed = replace(only(registry), state="resolved", resolved_ns=NOW + S, resolved_by="eve", revision=2)
    registry.learn(closed, NOW + S)
    registry.apply([opened(), edge("changed")], NOW + 2 * S)
    assert registry.of("r1") == ()
    assert news(registry) == []
    registry.tick(NOW + 5000 * S)  # it is held as long as its finding is not over
    registry.apply([edge("changed")], NOW + 5000 * S)
    assert registry.of("r1") == ()
    registry.apply([edge("changed", severity="error")], NOW + 5001 * S)
    assert (only(registry).id, only(registry).severity, only(registry).times) == (closed.id, "error", 2)


def test_the_end_of_what_somebody_resolved_is_stored_and_the_next_beginning_is_a_new_alert() -> None:
    registry = make()
    registry.apply([opened()], NOW)
    stored(registry)
    closed = replace(only(registry), state="resolved", resolved_ns=NOW + S, resolved_by="eve", revision=2)
    registry.learn(closed, NOW + S)
    registry.apply([cleared()], NOW + 1000 * S)
    ((alert, reported),) = stored(registry)
    assert (alert.state, alert.clear_ns, reported) == ("resolved", NOW + 1000 * S, ("seen",))
    registry.apply([opened()], NOW + 2000 * S)
    assert only(registry).id != closed.id


def test_a_robot_that_is_offline_is_reported_once() -> None:
    registry = make()
    registry.apply([opened(cause="silence", severity="error"), opened(cause="offline", series="")], NOW)
    offline, silent = sorted(registry.of("r1"), key=lambda alert: alert.cause)
    assert silent.inhibited_by == offline.id
    assert (silent.quiet, offline.quiet) == (True, False)
    registry.apply([cleared(cause="offline", series="")], NOW + S)
    registry.tick(NOW + 31 * S)
    assert not only(registry).quiet


def test_a_crashed_node_explains_the_topics_that_it_publishes() -> None:
    registry = make(topics_of=lambda robot, node: {"/scan"} if (robot, node) == ("r1", "lidar") else set())
    registry.apply([opened(cause="crash", series="lidar", severity="error")], NOW)
    registry.apply([opened(cause="silence", series="/scan"), opened(cause="rate", series="/odom")], NOW)
    quiet = {alert.cause: alert.quiet for alert in registry.of("r1")}
    assert quiet == {"crash": False, "silence": True, "rate": False}
    registry.apply([opened(cause="silence", series="/image")], NOW)
    assert not {alert.cause: alert.quiet for alert in registry.of("r1")}["silence"]


def test_nothing_but_offline_explains_what_is_worse_than_itself() -> None:
    registry = make()
    registry.apply([opened(cause="host", series="cpu"), opened(cause="rate", series="/scan", severity="error")], NOW)
    assert [alert.quiet for alert in registry.of("r1")] == [False, False]


def test_silences_begin_and_end_and_let_through_what_is_worse() -> None:
    registry = make()
    registry.silence([silence(robots=("r*",), causes=("heat",), up_to="warning", from_ns=NOW + 10 * S)], NOW)
    registry.apply([opened()], NOW)
    assert only(registry).silence == ""
    assert news(registry) == ["opened"]
    registry.tick(NOW + 10 * S)
    assert only(registry).silence == "S1"
    assert news(registry) == ["changed"]
    registry.apply([edge("changed", severity="error")], NOW + 11 * S)
    assert only(registry).silence == ""
    registry.apply([opened("r2"), opened("x1")], NOW + 12 * S)
    assert (only(registry, "r2").silence, only(registry, "x1").silence) == ("S1", "")
    registry.tick(NOW + 3600 * S)
    assert only(registry, "r2").silence == ""


def test_there_is_a_cap_per_robot_and_what_waits_is_said_once_and_not_lost() -> None:
    registry = make(alerts_per_robot=2)
    registry.apply([opened(cause=f"c{number}") for number in range(5)], NOW)
    registry.tick(NOW + S)
    causes = {alert.cause: alert for alert in registry.of("r1")}
    assert set(causes) == {"c0", "c1", "too_many"}
    assert causes["too_many"].value == 3.0
    registry.apply([cleared(cause="c0"), cleared(cause="c2")], NOW + 2 * S)
    registry.tick(NOW + 40 * S)
    assert {alert.cause for alert in registry.of("r1")} == {"c1", "c3", "too_many"}
    registry.apply([cleared(cause="c1"), cleared(cause="c4")], NOW + 41 * S)
    registry.tick(NOW + 80 * S)
    registry.tick(NOW + 111 * S)
    assert {alert.cause for alert in registry.of("r1")} == {"c3"}


def test_there_is_a_cap_for_the_fleet_and_one_alert_instead_of_a_storm() -> None:
    registry = make(alerts_unresolved=3, alert_findings_waiting=4)
    registry.apply([opened(f"r{number}") for number in range(10)], NOW)
    registry.tick(NOW + S)
    assert registry.unresolved == 3
    assert registry.refused == 3
    assert only(registry, "").reason == "4 findings wait for room: the fleet has as many alerts as can be"
    assert len(news(registry)) == 4


def test_what_is_not_reported_again_after_a_restart_is_over_after_the_grace() -> None:
    before = make()
    before.apply([opened(), opened(series="b"), opened(cause="battery")], NOW)
    found = [replace(alert, revision=1) for alert, _ in stored(before)]
    registry = make()
    for alert in found:
        registry.learn(alert, NOW)
    registry.adopt("r1", NOW)
    registry.apply([opened(series="b")], NOW + S)
    assert news(registry, NOW + S) == []  # known already
    registry.tick(NOW + 120 * S)
    heat, battery = sorted(registry.of("r1"), key=lambda alert: alert.cause, reverse=True)
    assert [item.finding.series for item in heat.findings if item.active] == ["b"]
    assert (heat.clear_ns, battery.clear_ns) == (0, NOW + 120 * S)
    registry.tick(NOW + 150 * S)
    assert only(registry).cause == "heat"


def test_what_a_rule_reported_needs_no_telling_again() -> None:
    registry = make()
    registry.apply([opened(kind="rule:hot", cause="rule:hot")], NOW)
    stored(registry)
    registry.adopt("r1", NOW)
    registry.tick(NOW + 3600 * S)
    assert (only(registry).state, only(registry).clear_ns) == ("open", 0)


def test_numbers_that_are_none_show_as_none() -> None:
    registry = make()
    registry.apply([opened(value=nan, low=-inf, high=inf, since_s=nan)], NOW)
    registry.apply([opened("r2", since_s=1e300)], NOW)
    alert = only(registry)
    assert (alert.value, alert.low, alert.high) == (None, None, None)
    assert (alert.first_ns, only(registry, "r2").first_ns) == (NOW, NOW)


def test_new_values_are_stored_now_and_then_only() -> None:
    registry = make(config=AlertConfig(settle_s=5.0))
    registry.apply([opened()], NOW)
    assert [change.news for change in registry.changes(NOW, most=9)] == [("opened",)]
    for tick in range(1, 10):
        registry.apply([edge("changed", value=91.0 + tick)], NOW + tick * S)
        assert bool(registry.changes(NOW + tick * S, most=9)) == (tick == 5)


def test_a_calendar_that_is_set_back_or_far_ahead_makes_no_storm() -> None:
    registry = make()
    registry.apply([opened(), opened(series="b")], NOW)
    registry.apply([cleared()], NOW - 10**6 * S)
    registry.apply([cleared(series="b")], NOW + 3 * 10**8 * S)  # ten years
    registry.tick(NOW)
    assert only(registry).clear_ns == NOW
    registry.tick(NOW + 30 * S)
    assert news(registry) == ["opened", "resolved"]


def known(registry: AlertRegistry, **more: Any) -> Alert:
    """The robot's alert as the store would have it after somebody else's change."""
    alert = only(registry)
    return replace(alert, revision=alert.revision + 1, **more)


def test_what_people_did_remote_and_what_was_found_here_are_both_kept() -> None:
    registry = make()
    registry.apply([opened()], NOW)
    stored(registry)
    remote = known(registry, state="acknowledged", acknowledged_ns=NOW + S, acknowledged_by="eve", assignee="bob")
    registry.apply([edge("changed", severity="error")], NOW + S)
    (change,) = registry.changes(NOW + S, most=9)
    registry.clashed(change, remote, NOW + 2 * S)
    alert = only(registry)
    assert (alert.state, alert.acknowledged_by, alert.assignee) == ("acknowledged", "eve", "bob")
    assert (alert.severity, alert.revision) == ("error", 2)
    assert news(registry) == ["escalated"]


def test_what_began_after_somebody_resolved_it_remote_is_not_lost() -> None:
    registry = make()
    registry.apply([opened()], NOW)
    stored(registry)
    remote = known(registry, state="resolved", resolved_ns=NOW + S, resolved_by="eve")
    registry.apply([opened(series="b")], NOW + 2 * S)
    (change,) = registry.changes(NOW + 2 * S, most=9)
    registry.clashed(change, remote, NOW + 3 * S)
    assert (only(registry).state, only(registry).times, only(registry).revision) == ("open", 2, 2)


def test_an_alert_that_another_gateway_opened_first_is_the_one() -> None:
    registry = make()
    registry.apply([opened()], NOW)
    (change,) = registry.changes(NOW, most=9)
    theirs = replace(change.alert, id="0" * 26, gateway="g2", revision=4, opened_ns=NOW - 5 * S)
    registry.clashed(change, theirs, NOW)
    assert (only(registry).id, only(registry).revision, only(registry).opened_ns) == ("0" * 26, 4, NOW - 5 * S)
    assert news(registry) == ["changed"]  # that it opened was told there


def test_an_alert_that_was_deleted_is_stored_again() -> None:
    registry = make()
    registry.apply([opened()], NOW)
    stored(registry)
    registry.apply([edge("changed", severity="error")], NOW)
    (change,) = registry.changes(NOW, most=9)
    registry.clashed(change, None, NOW)
    ((alert, reported),) = stored(registry)
    assert (alert.revision, reported) == (0, ("escalated",))


def remote_opened(registry: AlertRegistry, **more: Any) -> Alert:
    """The next alert of the same cause, which another gateway opened of a series of its own: "b"."""
    other = make()
    other.apply([opened(series="b", **more)], NOW)
    return replace(only(other), id="0" * 26, gateway="g2", revision=3)


def resolved_while_it_goes_on() -> AlertRegistry:
    """A book whose alert somebody resolved, and whose finding is not over."""
    registry = make()
    registry.apply([opened()], NOW)
    stored(registry)
    registry.learn(known(registry, state="resolved", resolved_ns=NOW + S, resolved_by="eve"), NOW + S)
    assert registry.of("r1") == ()
    return registry


def test_what_goes_on_belongs_to_the_alert_that_another_gateway_opened_next() -> None:
    registry = resolved_while_it_goes_on()
    registry.learn(remote_opened(registry), NOW + 2 * S)
    assert (only(registry).id, registry.unresolved) == ("0" * 26, 1)
    registry.apply([cleared(series="b")], NOW + 3 * S)
    assert only(registry).clear_ns == 0
    registry.apply([cleared()], NOW + 4 * S)
    assert only(registry).clear_ns == NOW + 4 * S


def test_of_an_alert_that_another_gateway_opened_next_only_what_was_reported_here_is_sure() -> None:
    for reported_again, left in ((True, ["motor.temperature"]), (False, [])):
        registry = resolved_while_it_goes_on()
        registry.adopt("r1", NOW + S)
        if reported_again:
            registry.apply([opened()], NOW + 2 * S)
        stored(registry)
        theirs = remote_opened(registry)
        mine = replace(theirs.findings[0], finding=opened().finding)
        registry.learn(replace(theirs, findings=(*theirs.findings, mine)), NOW + 3 * S)
        registry.tick(NOW + 200 * S)  # the grace is over
        alert = only(registry)
        assert [item.finding.series for item in alert.findings if item.active] == left
        assert (alert.id, alert.clear_ns == 0) == ("0" * 26, reported_again)


def test_what_another_gateway_stored_of_a_robot_that_is_taken_over_is_in_doubt() -> None:
    registry = make()
    registry.apply([opened()], NOW)
    stored(registry)
    registry.adopt("r1", NOW)
    registry.apply([opened()], NOW)
    stored(registry)
    theirs = known(registry, gateway="g2", severity="error")
    registry.learn(theirs, NOW + S)
    assert (only(registry).severity, only(registry).gateway) == ("error", "g1")
    registry.tick(NOW + 120 * S)
    assert only(registry).clear_ns == NOW + 120 * S
