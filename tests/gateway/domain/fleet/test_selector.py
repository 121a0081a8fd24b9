"""Selectors: their grammar, what they name, and what is refused."""

from __future__ import annotations

import contextlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gateway.domain.errors import SelectorError
from gateway.domain.fleet.selector import Selector, check_labels
from gateway.domain.fleet.twin import changes_code, is_template_name
from tests.support.tables import refusal

LABELS = {"site": "lab", "kind": "arm", "fleet.org/zone": "a-1"}


NAMED = (
    ("", True),
    ("  ", True),
    ("site=lab", True),
    ("site==lab", True),
    ("site = lab , kind=arm", True),
    ("site=lab,kind=cart", False),
    ("site!=hall", True),
    ("site!=lab", False),
    ("nothing!=lab", True),
    ("site in (hall, lab)", True),
    ("site in (hall)", False),
    ("site in(lab),kind", True),
    ("nothing in (lab)", False),
    ("kind", True),
    ("nothing", False),
    ("fleet.org/zone=a-1", True),
    ("robot=r1", True),
    ("robot in (r1, r2)", True),
    ("robot!=r1", False),
    ("in=x", False),
)


def test_who_is_named() -> None:
    assert [text for text, named in NAMED if Selector.parse(text).matches("r1", LABELS) is not named] == []


NO_SELECTORS = (
    ("site=", "'site=' is no term"),
    ("=lab", "'=lab' is no term"),
    ("site=lab kind=arm", "is no term"),
    ("site=lab,", "no term after the last comma"),
    ("site=lab,,kind", "',kind' is no term"),
    ("site in ()", "takes 1 to 256 values"),
    ("site in (a b)", "takes 1 to 256 values"),
    ("site in (a", "is no term"),
    ("si te", "is no term"),
    ("-x=1", "is no term"),
    ("a" * 5000, "at most 4096 characters"),
    (",".join(["a=b"] * 33), "at most 32 terms"),
    (f"a in ({','.join('b' * 257)})", "takes 1 to 256 values"),
    ("site=\x1b[31m", "is no term"),
)


def test_what_is_no_selector() -> None:
    said = [(text, why, refusal(SelectorError, Selector.parse, text)) for text, why in NO_SELECTORS]
    assert [case for case in said if case[1] not in case[2]] == []


@given(st.text(st.sampled_from("ab=!in(), ,\n\0é"), max_size=40))
def test_any_text_is_one_or_is_refused_and_means_itself(text: str) -> None:
    with contextlib.suppress(SelectorError):
        found = Selector.parse(text)
        assert Selector.parse(found.text).terms == found.terms


@pytest.mark.timeout(20)  # an expression that goes back and forth takes hours
def test_a_hostile_text_costs_no_time() -> None:
    for text in ("a" * 4096, "a " * 2048, "a in (" * 600, "(" * 4096, "a=" + "." * 4000, "a." * 2048):
        with pytest.raises(SelectorError, match="is no term"):
            Selector.parse(text)


def test_labels() -> None:
    check_labels({"site": "lab", "old": None, "a.b/c-d": "10.0.0.1:80"})
    for wrong in ({"": "x"}, {"robot": "x"}, {"a b": "x"}, {"a": ""}, {"a": "x y"}, {"a": "x" * 200}, {"-": "x"}):
        with pytest.raises(SelectorError):
            check_labels(wrong)
    with pytest.raises(SelectorError):
        check_labels({f"l{n}": "x" for n in range(65)})


def test_what_counts_as_other_code() -> None:
    node = {"bundle": "b", "version": "1.0", "args": ["-v"]}
    old = {"nodes": {"a": node}}
    assert changes_code(old, {"nodes": {"a": {**node, "nice": 5, "run": False}}}) == ""
    assert changes_code(old, {}) == ""
    assert changes_code(old, {"nodes": {"a": {**node, "version": "1.1"}}}) == "nodes.a.version"
    assert changes_code(old, {"nodes": {"a": {"allowed": "a"}}}) == "nodes.a.bundle"
    assert changes_code({}, {"nodes": {"a": {"allowed": "a"}}}) == "nodes.a.allowed"
    assert changes_code({"nodes": {"a": {"allowed": "a"}}}, {"nodes": {"a": {"allowed": "a", "nice": 3}}}) == ""
    one = {"nodes": {"a": {"allowed": "a"}}}
    assert changes_code(one, {"nodes": {"a": {"allowed": "a", "args": ["x"]}}}) == "nodes.a.args"
    assert changes_code({}, {"agent": {"version": "2.0"}}) == "agent.version"
    assert changes_code({"agent": {"version": "2.0"}}, {}) == ""
    assert (is_template_name("cams-2.1"), is_template_name("../x"), is_template_name("")) == (True, False, False)
