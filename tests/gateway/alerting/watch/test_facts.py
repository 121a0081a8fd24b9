"""Facts between two cycles: bounded, in their order, as JSON takes them."""

from __future__ import annotations

import math

import orjson

from gateway.alerting.watch.facts import Facts
from gateway.domain.fleet.twin import Reported


def report(nodes: object, *, whole: bytes | None = None) -> Reported:
    data = whole if whole is not None else orjson.dumps({"nodes": nodes})
    return Reported(
        robot="r1", at_ns=1, revision=1, applied=1, state="applied", code="", message="", sha256=b"", reported=data
    )


def told(before: object, after: object) -> list[list[object]]:
    facts = Facts()
    facts.report(report(before), report(after), 5.0)
    return facts.take(6.0)


def test_facts_are_taken_once_and_in_order() -> None:
    facts = Facts()
    facts.add("link", "r1", True, 1.0)
    facts.heartbeat("r1")
    facts.heartbeat("r2")
    facts.rates("r1", {"/a": 10.0, "/b": math.nan}, 2.0)
    assert facts.take(3.0) == [
        ["link", "r1", True, 1.0],
        ["rates", "r1", {"/a": 10.0}, 2.0],
        ["heard", ["r1", "r2"], 3.0],
    ]
    assert facts.take(4.0) == []


def test_what_is_beyond_the_bound_is_counted() -> None:
    facts = Facts(most=2)
    for number in range(5):
        facts.add("link", f"r{number}", True, 1.0)
        facts.heartbeat(f"r{number}")
    assert [fact[0] for fact in facts.take(1.0)] == ["link", "link", "heard"]
    assert facts.skipped == 3


def test_a_cohort_is_reported_where_it_is_news() -> None:
    facts = Facts()
    for cohort in ("", "a", "a", "b", ""):
        facts.cohort("r1", cohort)
    assert facts.take(1.0) == [["robot", "r1", "a"], ["robot", "r1", "b"], ["robot", "r1", ""]]


def test_nodes_that_began_again_or_were_given_up_are_reported() -> None:
    assert told({"n": {"restarts": 1, "crashes": 0}}, {"n": {"restarts": 2, "crashes": 1}}) == [
        ["node", "r1", "n", "restarted", 5.0]
    ]
    assert told({"n": {"quarantined": False}}, {"n": {"quarantined": True}}) == [
        ["node", "r1", "n", "quarantined", 5.0]
    ]
    assert told({"n": {"quarantined": True}}, {"n": {"quarantined": False}}) == [["node", "r1", "n", "running", 5.0]]
    assert told({"n": {"restarts": 2}}, {"n": {"restarts": 2}}) == []
    assert told({}, {"n": {"quarantined": True}}) == [["node", "r1", "n", "quarantined", 5.0]]


def test_a_report_that_is_no_such_json_is_nothing() -> None:
    facts = Facts()
    for whole in (b"", b"[", b"[]", b'{"nodes": 3}', b'{"nodes": {"n": 3}}', b'{"nodes": {"n": {"crashes": "x"}}}'):
        facts.report(report({}), report({}, whole=whole), 5.0)
        facts.report(None, report({}, whole=whole), 5.0)
    assert facts.take(1.0) == []


def test_what_a_robot_says_of_its_nodes_is_bounded() -> None:
    given_up = {"quarantined": True}
    assert told({}, {"x" * 257: given_up, "y" * 256: given_up}) == [["node", "r1", "y" * 256, "quarantined", 5.0]]
    assert len(told({}, {f"n{number}": given_up for number in range(10_000)})) == 256
