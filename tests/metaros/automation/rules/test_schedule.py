"""Schedules: AWS's cron, rates and single times, over changes of clocks."""

from __future__ import annotations

from datetime import UTC, datetime
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from metaros.automation.rules.errors import ScheduleError
from metaros.automation.rules.schedule import Schedule
from tests.support.tables import cases

NS = 1_000_000_000


def ns(text: str) -> int:
    """A time of UTC, or with its offset."""
    moment = datetime.fromisoformat(text)
    return int((moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()) * NS


def times(schedule: Schedule, after: str, count: int) -> list[str]:
    """The next times, in UTC."""
    found, at_ns = [], ns(after)
    for _ in range(count):
        next_ns = schedule.next_after(at_ns)
        if next_ns is None:
            break
        found.append(datetime.fromtimestamp(next_ns / NS, UTC).strftime("%Y-%m-%dT%H:%M"))
        at_ns = next_ns
    return found


@cases(
    ("text", "expected"),
    [
        ("0 10 * * ? *", ["2026-01-01T10:00", "2026-01-02T10:00"]),
        ("15 12 * * ? *", ["2026-01-01T12:15", "2026-01-02T12:15"]),
        ("0 18 ? * MON-FRI *", ["2026-01-01T18:00", "2026-01-02T18:00", "2026-01-05T18:00"]),
        ("0 8 1 * ? *", ["2026-01-01T08:00", "2026-02-01T08:00"]),
        ("0/15 * * * ? *", ["2026-01-01T00:15", "2026-01-01T00:30", "2026-01-01T00:45", "2026-01-01T01:00"]),
        ("0/10 * ? * MON-FRI *", ["2026-01-01T00:10", "2026-01-01T00:20"]),
        ("0/30 20-2 ? * * *", ["2026-01-01T00:30", "2026-01-01T01:00", "2026-01-01T01:30", "2026-01-01T02:00"]),
        ("1/10 0 1 1 ? *", ["2026-01-01T00:01", "2026-01-01T00:11"]),
        ("0 0 L * ? *", ["2026-01-31T00:00", "2026-02-28T00:00", "2026-03-31T00:00"]),
        ("0 0 LW * ? *", ["2026-01-30T00:00", "2026-02-27T00:00", "2026-03-31T00:00"]),
        ("0 0 15W * ? *", ["2026-01-15T00:00", "2026-02-16T00:00", "2026-03-16T00:00"]),
        ("0 0 1W * ? 2026", ["2026-02-02T00:00", "2026-03-02T00:00", "2026-04-01T00:00"]),
        ("0 0 31W * ? *", ["2026-01-30T00:00", "2026-03-31T00:00", "2026-05-29T00:00"]),
        ("0 0 1,15,L * ? *", ["2026-01-15T00:00", "2026-01-31T00:00", "2026-02-01T00:00"]),
        ("0 0 ? * L *", ["2026-01-03T00:00", "2026-01-10T00:00"]),
        ("0 0 ? * 6L *", ["2026-01-30T00:00", "2026-02-27T00:00"]),
        ("0 0 ? * FRIL *", ["2026-01-30T00:00", "2026-02-27T00:00"]),
        ("0 0 ? * 3#2 *", ["2026-01-13T00:00", "2026-02-10T00:00"]),
        ("0 0 ? * TUE#5 *", ["2026-03-31T00:00", "2026-06-30T00:00"]),
        ("0 0 ? * 1 *", ["2026-01-04T00:00", "2026-01-11T00:00"]),
        ("0 0 ? * FRI-MON *", ["2026-01-02T00:00", "2026-01-03T00:00", "2026-01-04T00:00", "2026-01-05T00:00"]),
        ("0 0 ? jan,Mar SUN#1 *", ["2026-01-04T00:00", "2026-03-01T00:00", "2027-01-03T00:00"]),
        ("0 0 29 2 ? *", ["2028-02-29T00:00", "2032-02-29T00:00"]),
        ("0 0 29 FEB ? 2090-2110", ["2092-02-29T00:00", "2096-02-29T00:00", "2104-02-29T00:00"]),
        ("0 12 1 1 ? 2026/3", ["2026-01-01T12:00", "2029-01-01T12:00"]),
        ("59 23 31 12 ? 2199", ["2199-12-31T23:59"]),
        ("0 0 30 2 ? *", []),
        ("0 0 1 1 ? 2020", []),
        ("0 0 1 1 ? 1970-2025", []),
    ],
)
def test_cron_as_aws_has_it(text: str, expected: list[str]) -> None:
    assert times(Schedule.parse(f"cron({text})"), "2026-01-01T00:00", max(1, len(expected))) == expected


@cases(
    ("text", "expected"),
    [
        ("*/20 * * * *", ["2026-01-01T00:20", "2026-01-01T00:40"]),
        ("0 9 * * 1-5", ["2026-01-01T09:00", "2026-01-02T09:00", "2026-01-05T09:00"]),
        ("0 9 * * 0", ["2026-01-04T09:00"]),
        ("0 9 * * 7", ["2026-01-04T09:00"]),
        ("0 9 * * 5-7", ["2026-01-02T09:00", "2026-01-03T09:00", "2026-01-04T09:00", "2026-01-09T09:00"]),
        ("0 9 * * 0-7", ["2026-01-01T09:00", "2026-01-02T09:00", "2026-01-03T09:00", "2026-01-04T09:00"]),
        ("0 9 * * sat,SUN", ["2026-01-03T09:00", "2026-01-04T09:00"]),
        ("30 6 1 * *", ["2026-01-01T06:30", "2026-02-01T06:30"]),
        ("cron(30 6 1 * *)", ["2026-01-01T06:30", "2026-02-01T06:30"]),
    ],
)
def test_the_five_fields_of_unix(text: str, expected: list[str]) -> None:
    assert times(Schedule.parse(text), "2026-01-01T00:00", len(expected)) == expected


@cases(
    ("zone", "text", "after", "expected"),
    [
        # Paris leaps from 02:00 to 03:00 at 01:00 UTC on 29 March, and goes back from 03:00 to 02:00 on 25 October
        ("Europe/Paris", "30 2 * * ? *", "2026-03-27T12:00", ["2026-03-28T01:30", "2026-03-30T00:30"]),
        ("Europe/Paris", "0 3 * * ? *", "2026-03-28T12:00", ["2026-03-29T01:00", "2026-03-30T01:00"]),
        ("Europe/Paris", "30 2 * * ? *", "2026-10-24T12:00", ["2026-10-25T00:30", "2026-10-26T01:30"]),
        ("Europe/Paris", "30 2 * * ? *", "2026-10-25T00:59", ["2026-10-26T01:30"]),
        ("Europe/Paris", "30 2 * * ? *", "2026-10-25T01:10", ["2026-10-26T01:30"]),
        (
            "Europe/Paris",
            "0 * * * ? *",
            "2026-10-24T23:30",
            ["2026-10-25T00:00", "2026-10-25T02:00", "2026-10-25T03:00"],
        ),
        (
            "Europe/Paris",
            "0 * * * ? *",
            "2026-03-28T23:30",
            ["2026-03-29T00:00", "2026-03-29T01:00", "2026-03-29T02:00"],
        ),
        # New York: 8 March at 07:00 UTC, 1 November at 06:00 UTC
        ("America/New_York", "15 2 * * ? *", "2026-03-07T12:00", ["2026-03-09T06:15"]),
        ("America/New_York", "0 12 * * ? *", "2026-03-07T12:00", ["2026-03-07T17:00", "2026-03-08T16:00"]),
        ("America/New_York", "15 1 * * ? *", "2026-10-31T12:00", ["2026-11-01T05:15", "2026-11-02T06:15"]),
        ("America/New_York", "15 1 * * ? *", "2026-11-01T05:15", ["2026-11-02T06:15"]),
        # Lord Howe: half an hour, back on 5 April at 15:00 UTC of the 4th, forth on 4 October at 15:30 UTC of the 3rd
        ("Australia/Lord_Howe", "45 1 * * ? *", "2026-04-03T20:00", ["2026-04-04T14:45", "2026-04-05T15:15"]),
        ("Australia/Lord_Howe", "0 2 * * ? *", "2026-04-03T20:00", ["2026-04-04T15:30", "2026-04-05T15:30"]),
        ("Australia/Lord_Howe", "15 2 * * ? *", "2026-10-02T00:00", ["2026-10-02T15:45", "2026-10-04T15:15"]),
        ("Australia/Lord_Howe", "30 2 * * ? *", "2026-10-02T20:00", ["2026-10-03T15:30", "2026-10-04T15:30"]),
        # Samoa left out the 30th of December 2011
        ("Pacific/Apia", "0 12 30 12 ? *", "2011-12-01T00:00", ["2012-12-29T22:00"]),
    ],
)
def test_changes_of_clocks(zone: str, text: str, after: str, expected: list[str]) -> None:
    assert times(Schedule.parse(f"cron({text})", zone), after, len(expected)) == expected


def test_rates_count_from_their_start_whatever_clocks_do() -> None:
    every = Schedule.parse("rate(5 minutes)")
    assert times(every, "2026-01-01T00:03", 2) == ["2026-01-01T00:05", "2026-01-01T00:10"]
    daily = Schedule.parse("rate(1 day)", "Europe/Paris", start_ns=ns("2026-03-28T12:00+01:00"))
    assert times(daily, "2026-03-28T00:00", 2) == ["2026-03-29T11:00", "2026-03-30T11:00"]
    assert daily.next_after(ns("2026-03-28T11:00")) == ns("2026-03-29T11:00")
    assert Schedule.parse("rate(12 hours)").next_after(ns("2026-01-01T12:00") + 1) == ns("2026-01-02T00:00")


def test_a_single_time() -> None:
    once = Schedule.parse("at(2026-12-24T18:00:30)", "Europe/Paris")
    assert once.next_after(ns("2026-01-01T00:00")) == ns("2026-12-24T17:00:30")
    assert once.next_after(ns("2026-12-24T17:00:30")) is None
    twice = Schedule.parse("at(2026-10-25T02:30:00)", "Europe/Paris")
    assert twice.next_after(0) == ns("2026-10-25T00:30")


@cases(
    ("text", "zone", "said"),
    [
        ("every day", "UTC", "is cron(0 9 ? * MON-FRI *), rate(5 minutes) or at("),
        ("cron(0 9 * *)", "UTC", "cron: has six fields"),
        ("cron(" + "0" * 300 + " 9 * * ? *)", "UTC", "cron: has six fields"),
        ("cron(0 9 * * * *)", "UTC", "day-of-week: exactly one of day-of-month and day-of-week is ?"),
        ("cron(0 9 ? * ? *)", "UTC", "day-of-week: exactly one of"),
        ("cron(60 9 * * ? *)", "UTC", "minutes: '60' is none of 0 to 59"),
        ("cron(0 24 * * ? *)", "UTC", "hours: '24' is none of 0 to 23"),
        ("cron(0 0 32 * ? *)", "UTC", "day-of-month: '32' is none of 1 to 31"),
        ("cron(0 0 0W * ? *)", "UTC", "day-of-month: '0' is none of 1 to 31"),
        ("cron(0 0 20-10 * ? *)", "UTC", "day-of-month: '20-10' goes backwards"),
        ("cron(0 0 1 13 ? *)", "UTC", "month: '13' is none of 1 to 12, or JAN"),
        ("cron(0 0 ? * 0 *)", "UTC", "day-of-week: '0' is none of 1 to 7, or SUN"),
        ("cron(0 0 ? * 3#6 *)", "UTC", "day-of-week: '3#6': a month has a first to a fifth"),
        ("cron(0 0 ? * XL *)", "UTC", "day-of-week: 'X' is none of"),
        ("cron(0 0 1 1 ? 2200)", "UTC", "year: '2200' is none of 1970 to 2199"),
        ("cron(*/0 * * * ? *)", "UTC", "minutes: '*/0': a step is a whole number"),
        ("cron(*/ * * * ? *)", "UTC", "minutes: '*/': a step is a whole number"),
        ("cron(, * * * ? *)", "UTC", "minutes: '' is none of"),
        ("0 9 1 * 1", "UTC", "day-of-week: with five fields, one of day-of-month and day-of-week is *"),
        ("0 9 * * 1#2", "UTC", "day-of-week: '1#2': with five fields, days 0 to 7"),
        ("rate(1 minutes)", "UTC", "rate: '1 minutes' is not like"),
        ("rate(5 minute)", "UTC", "rate: '5 minute' is not like"),
        ("rate(0 minutes)", "UTC", "rate:"),
        ("rate(5 weeks)", "UTC", "rate:"),
        ("at(2026-12-24)", "UTC", "at: '2026-12-24' is no time like"),
        ("at(2026-02-30T00:00:00)", "UTC", "at:"),
        ("at(2026-12-24T18:00:00Z)", "UTC", "at:"),
        ("at(2026-03-29T02:30:00)", "Europe/Paris", "at: 2026-03-29T02:30:00: the clocks of Europe/Paris leap over"),
        ("rate(1 day)", "Europe/Atlantis", "timezone: 'Europe/Atlantis' is no time zone like Europe/Paris"),
        ("rate(1 day)", "../../etc/passwd", "timezone:"),
        ("rate(1 day)", "", "timezone:"),
        ("rate(1 day)", "Europe", "timezone:"),
    ],
)
def test_what_is_refused_is_named_by_its_field(text: str, zone: str, said: str) -> None:
    with pytest.raises(ScheduleError) as caught:
        Schedule.parse(text, zone)
    assert said in str(caught.value)
    assert caught.value.code == "schedule_invalid"


EXPRESSIONS = st.sampled_from(
    ["cron(*/7 * * * ? *)", "cron(30 2 * * ? *)", "cron(15 1 ? * SUN *)", "cron(0 0 LW * ? *)", "rate(7 minutes)"]
)
ZONES = st.sampled_from(["UTC", "Europe/Paris", "America/New_York", "Australia/Lord_Howe", "Asia/Kathmandu"])


@settings(max_examples=60, deadline=None)
@given(EXPRESSIONS, ZONES, st.integers(0, 4_000_000_000 * NS), st.integers(0, 40 * 86_400 * NS))
def test_no_time_is_between_a_moment_and_the_next(text: str, zone: str, t_ns: int, later_ns: int) -> None:
    """Asked at any moment before the time that was told, it tells the same time."""
    schedule = Schedule.parse(text, zone)
    reported = schedule.next_after(t_ns)
    assert reported is not None
    assert reported > t_ns
    assert schedule.next_after(min(t_ns + later_ns, reported - 1)) == reported


@cases(
    ("begin", "end", "gaps", "count"),
    [
        ("2026-04-01", "2026-04-08", {1800 * NS, 3600 * NS}, 7 * 48 - 1),  # half an hour that comes twice counts once
        ("2026-10-01", "2026-10-08", {1800 * NS}, 7 * 48),  # one that is leapt over never came
    ],
)
def test_times_are_strictly_later_each_over_weeks_in_which_clocks_change(
    begin: str, end: str, gaps: set[int], count: int
) -> None:
    schedule, at_ns, found = Schedule.parse("cron(0/30 * * * ? *)", "Australia/Lord_Howe"), ns(begin), []
    while at_ns < ns(end):
        at_ns = schedule.next_after(at_ns) or 0
        found.append(at_ns)
    assert {later - earlier for earlier, later in pairwise(found)} == gaps
    assert len(found) == count
