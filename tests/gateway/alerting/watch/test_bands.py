"""Bands: points of wanted series alone, bounded."""

from __future__ import annotations

from gateway.alerting.watch.bands import Bands
from gateway.alerting.watch.rows import BandPoint


def point(stamp_ns: int) -> BandPoint:
    return BandPoint(stamp_ns, 1.0, 0.0, 2.0, 0.1)


def test_only_wanted_series_are_kept_and_a_span_of_them_is_read() -> None:
    bands = Bands(max_points=5)
    bands.want("r1", "a")
    for stamp_ns in range(10):
        bands.add([(("r1", "a"), point(stamp_ns)), (("r1", "b"), point(stamp_ns))])
    assert [found.stamp_ns for found in bands.read("r1", "a", 0, 100)] == [5, 6, 7, 8, 9]
    assert [found.stamp_ns for found in bands.read("r1", "a", 6, 8)] == [6, 7, 8]
    assert bands.read("r1", "b", 0, 100) == []


def test_the_series_that_was_wanted_longest_ago_gives_way() -> None:
    bands = Bands(max_series=2)
    for series in ("a", "b", "a", "c"):
        bands.want("r1", series)
    assert bands.wanted() == {"r1": {"a", "c"}}


def test_what_is_not_expected_stays_nothing() -> None:
    bands = Bands()
    bands.want("r1", "a")
    bare = BandPoint(2**62 + 1, -3.5, None, None, 0.0)
    bands.add([(("r1", "a"), bare)])
    assert bands.read("r1", "a", 0, 2**63) == [bare]


def test_one_robot_takes_no_others_place() -> None:
    bands = Bands(max_of_robot=2)
    bands.want("other", "a")
    for number in range(1000):
        bands.want("r1", f"s{number}")
    assert bands.wanted() == {"other": {"a"}, "r1": {"s998", "s999"}}
