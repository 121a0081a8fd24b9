"""Conditions with a memory: each alone, together in their order, with clocks that jump."""

from __future__ import annotations

import dataclasses
import json
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from metaros.automation.rules.errors import WhenError
from metaros.automation.rules.when import SLACK_NS, State, Step, When, at_rest, due, group_of, step, value_of
from metaros.limits import LIMITS
from tests.support.tables import cases

S = 1_000_000_000


class Group:
    """One group of a rule: hand in events at times in seconds, timers are called as they come due."""

    def __init__(self, **document: Any) -> None:
        self.when = When.parse({name.rstrip("_"): value for name, value in document.items()})
        self.state = State()
        self.due_ns: int | None = None
        self.told: list[tuple[float, str]] = []

    def at(self, *times_s: float, matched: bool = True, value: float | None = None) -> Group:
        """Events at these times."""
        for time_s in times_s:
            self.until(time_s, called=False)
            self._keep(step(self.when, self.state, matched, value, round(time_s * S)), time_s)
        return self

    def no(self, *times_s: float) -> Group:
        """Events that do not match."""
        return self.at(*times_s, matched=False)

    def until(self, time_s: float, *, called: bool = True) -> Group:
        """Timers up to a time; that of this very time only if `called`."""
        while self.due_ns is not None and (self.due_ns < time_s * S or (called and self.due_ns == time_s * S)):
            at_s = self.due_ns / S
            self._keep(due(self.when, self.state, self.due_ns), at_s)
        return self

    def _keep(self, came: Step, at_s: float) -> None:
        self.told += [(at_s, "act")] * came.fired + [(at_s, "end")] * came.ended
        self.state = State.from_json(json.loads(json.dumps(came.state.to_json())))
        assert self.state == came.state
        self.due_ns = came.due_ns

    @property
    def acts(self) -> list[float]:
        """When it acted."""
        return [at for at, what in self.told if what == "act"]

    @property
    def ends(self) -> list[float]:
        """When a level ended."""
        return [at for at, what in self.told if what == "end"]


def test_without_conditions_every_matching_event_acts() -> None:
    group = Group().at(1, 2).no(3).at(4)
    assert group.acts == [1, 2, 4]
    assert group.ends == [3]


def test_for_acts_once_after_it_has_held_so_long() -> None:
    group = Group(for_="5s").at(1, 3).until(5.9)
    assert group.acts == []
    assert group.until(20).at(21).acts == [6]
    assert group.no(22).ends == [22]
    assert group.at(23).no(27).until(60).acts == [6]
    assert group.at(61).until(66).acts == [6, 66]


def test_for_without_a_timer_acts_with_the_next_event() -> None:
    when = When.parse({"for": 5})
    came = step(when, State(), True, None, 0)
    assert came.due_ns == 5 * S
    assert step(when, came.state, True, None, 7 * S).fired
    late = step(when, came.state, False, None, 7 * S)
    assert late.fired
    assert late.ended
    assert late.due_ns is None


@cases(("edge", "acts"), [("rising", [1, 5]), ("falling", [3]), ("both", [1, 3, 5])])
def test_edges(edge: str, acts: list[float]) -> None:
    assert Group(edge=edge).no(0).at(1, 2).no(3, 4).at(5, 6).acts == acts


def test_falling_edge_of_a_level_that_lasted() -> None:
    group = Group(for_="5s", edge="falling").at(0).no(3).at(10).until(15).no(20)
    assert group.acts == [20]
    assert group.ends == [20]


def test_hysteresis_downwards() -> None:
    group = Group(hysteresis={"enter": 20, "exit": 25})
    for at, value in enumerate([30, 21, 20, 22, 24.9, 19, 25, 24, 20]):
        group.at(at, value=value)
    assert group.acts == [2, 8]
    assert group.ends == [6]


def test_hysteresis_upwards_with_a_duration() -> None:
    group = Group(hysteresis={"enter": 80, "exit": 70}, for_="10s")
    group.at(0, value=81).at(5, value=75).until(9).at(9, value=69)
    assert group.acts == []
    group.at(20, value=80).at(25, value=None).at(26, value=float("nan")).until(40)
    assert group.acts == [30]


@cases("direction", ["above", "below"])
def test_hysteresis_of_one_bound(direction: str) -> None:
    group = Group(hysteresis={"enter": 20, "exit": 20, "direction": direction})
    sign = 1 if direction == "above" else -1
    group.at(0, value=20).at(1, value=20).at(2, value=20 - sign).at(3, value=20 + sign)
    assert group.acts == [0, 3]


def test_rate_counts_within_a_window_and_begins_anew() -> None:
    group = Group(rate={"count": 3, "within": "10s"}).at(0, 4, 11, 12)
    assert group.acts == [12]
    assert group.at(13, 14).acts == [12]
    assert group.at(15).acts == [12, 15]
    assert group.state.pulses_ns == ()
    assert Group(rate={"count": 2, "within": "10s"}).at(0, 10, 19.9).acts == [19.9]


def test_rate_keeps_fewer_stamps_than_it_counts() -> None:
    group = Group(rate={"count": 5, "within": "1h"})
    for at in range(1000):
        group.at(at)
        assert len(group.state.pulses_ns) < 5
    assert len(group.acts) == 200


def test_debounce_trailing_acts_when_it_is_quiet() -> None:
    group = Group(debounce="2s").at(0, 1, 2.5).until(4.4)
    assert group.acts == []
    assert group.until(10).at(11).until(20).acts == [4.5, 13]


def test_debounce_leading_acts_at_once_and_then_waits_for_quiet() -> None:
    group = Group(debounce={"quiet": "2s", "fires": "leading"}).at(0, 1, 2.5, 4.4, 6.4)
    assert group.acts == [0, 6.4]
    assert group.due_ns is None


def test_cooldown_drops_what_comes_too_soon() -> None:
    assert Group(cooldown="10s").at(0, 3, 9.9, 10, 12, 30).acts == [0, 10, 30]


def test_absent_for_acts_once_and_ends_with_the_next_event() -> None:
    group = Group(absent_for="10s").at(0, 5).until(14)
    assert group.acts == []
    group.until(100)
    assert group.acts == [15]
    assert group.no(101).ends == []
    assert group.at(102).until(200).ends == [102]
    assert group.acts == [15, 112]


def test_absent_for_can_begin_before_any_event() -> None:
    when = When.parse({"absent_for": "10s", "group_by": []})
    armed = due(when, State(), 5 * S)
    assert (armed.fired, armed.due_ns) == (False, 15 * S)
    assert due(when, armed.state, 15 * S).fired


def test_absent_for_with_a_cooldown() -> None:
    assert Group(absent_for="10s", cooldown="1m").at(0).until(11).at(20).until(31).at(65).until(80).acts == [10, 75]


def test_an_event_after_the_time_of_an_absence_acts_and_ends() -> None:
    when = When.parse({"absent_for": "10s"})
    came = step(when, step(when, State(), True, None, 0).state, True, None, 12 * S)
    assert (came.fired, came.ended, came.due_ns) == (True, True, 22 * S)


def test_the_order_is_for_edge_rate_debounce_cooldown() -> None:
    group = Group(for_="1s", edge="both", rate={"count": 2, "within": "1m"}, debounce="2s", cooldown="30s")
    group.at(0).until(1).no(3).until(4.9)  # held at 1, ended at 3: two pulses, then quiet until 5
    assert group.acts == []
    assert group.until(9).acts == [5]
    group.at(10).until(11).no(12).until(20)  # the same at 14, but too soon
    assert group.acts == [5]
    assert group.at(40).until(41).no(42).until(50).acts == [5, 44]


def test_a_clock_a_little_back_stands_still() -> None:
    group = Group(for_="10s").at(100)
    group.at(95)
    assert group.due_ns == 110 * S
    assert group.until(110).acts == [110]


def test_a_clock_far_back_takes_what_waits_with_it() -> None:
    group = Group(for_="100s", cooldown="1h").at(1000).at(1030)
    group._keep(step(group.when, group.state, True, None, 500 * S), 500)
    assert group.due_ns == 570 * S
    assert group.until(600).acts == [570]
    assert SLACK_NS < 500 * S


def test_a_clock_ahead_makes_due_what_waits_once() -> None:
    group = Group(for_="10s", cooldown="1m").at(0)
    group._keep(due(group.when, group.state, 10**9 * S), 10**9)
    assert group.acts == [10**9]
    assert group.at(10**9 + 1).until(10**9 + 100).acts == [10**9]


@cases(
    ("document", "said"),
    [
        ({"fore": "5s"}, "fore: there is no such condition; there are for, debounce,"),
        ({"for": "soon"}, "for: is a time like '5s'"),
        ({"for": "5"}, "for: is a time like '5s'"),
        ({"for": 0}, "for: is longer than 0 and at most"),
        ({"for": True}, "for: is a time like"),
        ({"for": float("inf")}, "for: is a time like"),
        ({"cooldown": "400d"}, "cooldown: is longer than 0 and at most 3.16224e+07 s (rule_period_s)"),
        ({"debounce": {"fires": "leading"}}, "debounce: is an object like"),
        ({"debounce": {"quiet": "1s", "fires": "first"}}, "debounce.fires: is leading or trailing"),
        ({"rate": "5 in 1m"}, "rate: is an object like {'count': 5, 'within': '1m'}"),
        ({"rate": {"count": 1, "within": "1m"}}, "rate.count: is a whole number from 2 to 1000 (rule_rate)"),
        ({"rate": {"count": 2, "within": "x"}}, "rate.within: is a time"),
        ({"hysteresis": {"enter": 5}}, "hysteresis: is an object like"),
        ({"hysteresis": {"enter": "5", "exit": 6}}, "hysteresis: enter and exit are numbers"),
        ({"hysteresis": {"enter": 5, "exit": 5}}, "hysteresis.direction: is above or below; it must be said"),
        ({"hysteresis": {"enter": 5, "exit": 6, "direction": "above"}}, "goes the other way"),
        ({"hysteresis": {"enter": 5, "exit": 6, "field": "a..b"}}, "hysteresis.field: is the path"),
        (
            {"absent_for": "5s", "for": "1s", "edge": "both"},
            "absent_for: goes with cooldown and group_by only, not with edge",
        ),
        ({"edge": "up"}, "edge: is rising, falling or both"),
        ({"group_by": ["a", "b", "c", "d", "e"]}, "group_by: at most 4 fields (rule_group_paths)"),
        ({"group_by": [5]}, "group_by: is robot"),
        ([], "is an object like"),
    ],
)
def test_what_is_refused_is_named_by_its_key(document: Any, said: str) -> None:
    with pytest.raises(WhenError) as caught:
        When.parse(document)
    assert said in str(caught.value)
    assert caught.value.code == "when_invalid"


@cases(
    ("text", "length_s"),
    [("5s", 5), ("2m", 120), ("1h", 3600), ("250ms", 0.25), ("1h30m", 5400), ("1d", 86400), (2.5, 2.5)],
)
def test_times(text: Any, length_s: float) -> None:
    assert When.parse({"for": text}).for_ns == length_s * S


def test_limits_are_those_that_were_passed() -> None:
    with pytest.raises(WhenError, match="at most 60 s"):
        When.parse({"for": "61s"}, limits=dataclasses.replace(LIMITS, rule_period_s=60))


def test_groups() -> None:
    event = {"source": "x", "detail": {"robot": "spot", "joint": {"id": 7}, "list": [1, "b"], "ok": True, "none": None}}
    assert group_of(When.parse({}), event) == "spot"
    assert group_of(When.parse({"group_by": []}), event) == ""
    assert group_of(When.parse({"group_by": "$.detail.joint.id"}), event) == "7"
    assert group_of(When.parse({"group_by": "detail.list.1"}), event) == "b"
    assert group_of(When.parse({"group_by": "detail.list.9"}), event) == ""
    assert group_of(When.parse({"group_by": ["robot", "detail.ok", "detail.none", "detail.joint"]}), event) == (
        '["spot",true,null,null]'
    )
    assert len(group_of(When.parse({}), {"detail": {"robot": "r" * 9999}})) == 64


def test_the_value_of_a_field() -> None:
    when = When.parse({"hysteresis": {"enter": 1, "exit": 2, "field": "detail.data.percentage"}})
    assert value_of(when, {"detail": {"data": {"percentage": 0.5}}}) == 0.5
    assert value_of(when, {"detail": {"data": {"percentage": True}}}) is None
    assert value_of(when, {"detail": 5}) is None
    assert value_of(When.parse({}), {}) is None


def test_a_state_from_another_version_is_read_as_far_as_it_is_known() -> None:
    assert State.from_json({"level": True, "of_tomorrow": 5}) == State(level=True)


PERIODS = st.sampled_from(["1s", "3s", "10s"])
WHENS = st.fixed_dictionaries(
    {},
    optional={
        "for": PERIODS,
        "debounce": PERIODS
        | st.fixed_dictionaries({"quiet": PERIODS, "fires": st.sampled_from(["leading", "trailing"])}),
        "cooldown": PERIODS,
        "rate": st.fixed_dictionaries({"count": st.integers(2, 4), "within": PERIODS}),
        "edge": st.sampled_from(["rising", "falling", "both"]),
        "hysteresis": st.sampled_from([{"enter": 2, "exit": 4}, {"enter": 4, "exit": 2}]),
    },
) | st.fixed_dictionaries({"absent_for": PERIODS}, optional={"cooldown": PERIODS})
EVENTS = st.lists(st.tuples(st.integers(0, 8), st.booleans(), st.integers(0, 6)), max_size=40)


@settings(max_examples=40, deadline=None)
@given(WHENS, EVENTS)
def test_a_state_at_rest_may_be_forgotten(document: dict[str, Any], events: list[tuple[int, bool, int]]) -> None:
    """Dropping it wherever that is allowed changes no act, whatever the conditions; timers end by themselves."""
    kept, dropped, at = Group(**document), Group(**document), 0
    for gap, matched, value in events:
        at += gap
        for group in (kept, dropped):
            group.at(at, matched=matched, value=value)
        if at_rest(dropped.when, dropped.state, at * S):
            dropped.state = State()
    for group in (kept, dropped):
        group.until(at + 1000)
        assert group.due_ns is None
    assert kept.acts == dropped.acts
