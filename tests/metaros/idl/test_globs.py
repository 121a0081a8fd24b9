"""Patterns over topic names."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from metaros.errors import NameError_
from metaros.idl.globs import Glob
from tests.support.tables import cases


@cases(
    ("pattern", "topic", "expected"),
    [
        ("/chatter", "/chatter", True),
        ("/chatter", "/chatter2", False),
        ("/sim_1/**", "/sim_1/scan", True),
        ("/sim_1/**", "/sim_1/camera/image", True),
        ("/sim_1/**", "/sim_1", True),
        ("/sim_1/**", "/sim_10/scan", False),
        ("/sim_*/**", "/sim_10/scan", True),
        ("**/odom", "/odom", True),
        ("**/odom", "/sim_1/base/odom", True),
        ("**/odom", "/sim_1/xodom", False),
        ("**", "/anything/at/all", True),
        ("/**", "/anything", True),
        ("/*", "/a", True),
        ("/*", "/a/b", False),
        ("/a/*/c", "/a/b/c", True),
        ("/a/*/c", "/a/b/b/c", False),
        ("/a/**/c", "/a/c", True),
        ("/a/**/c", "/a/b/b/c", True),
        ("/a/**/c", "/a/b/b/d", False),
        ("/*_scan*/x", "/front_scan_2/x", True),
        ("*", "sim_1", True),
        ("sim_*", "sim_1", True),
        ("/a/**/b/**/c", "/a/b/x/b/y/c", True),
    ],
)
def test_matches(pattern: str, topic: str, expected: bool) -> None:
    assert Glob(pattern).matches(topic) is expected


def test_another_separator() -> None:
    assert Glob("host.*.percent", separator=".").matches("host.cpu.percent")
    assert Glob("**", separator=".").matches("battery_state.percentage")
    assert not Glob("host.*", separator=".").matches("host.cpu.percent")


@cases("pattern", ["", "a b", "{a,b}", "a?", "x" * 300, "é"])
def test_bad_patterns(pattern: str) -> None:
    with pytest.raises(NameError_):
        Glob(pattern)


def test_a_hostile_pattern_is_not_slow() -> None:
    assert not Glob("*a" * 120 + "b").matches("a" * 256)
    assert not Glob("**/a/" * 50 + "b").matches("/a" * 120)


def test_equality() -> None:
    assert Glob("/a/*") == Glob("/a/*")
    assert len({Glob("/a/*"), Glob("/a/*"), Glob("/b")}) == 2
    assert repr(Glob("/a")) == "Glob('/a')"


SEGMENTS = st.lists(st.sampled_from(["a", "b", "ab"]), min_size=1, max_size=5)


@settings(max_examples=40)
@given(SEGMENTS, st.data())
def test_replacing_parts_by_wildcards_still_matches(segments: list[str], data: st.DataObject) -> None:
    cut = data.draw(st.integers(0, len(segments)))
    width = data.draw(st.integers(0, len(segments) - cut))
    topic = "/" + "/".join(segments)
    pattern = "/" + "/".join([*segments[:cut], "**", *segments[cut + width :]])
    assert Glob(pattern).matches(topic)
