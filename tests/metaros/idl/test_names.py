"""The grammar of ROS names."""

from __future__ import annotations

import pytest

from metaros.errors import NameError_
from metaros.idl import names
from tests.support.tables import cases


@cases("name", ["chatter", "/chatter", "/a/b_2/C", "~/x", "~", "_hidden", "a/_b"])
def test_good_topics(name: str) -> None:
    assert names.validate_topic(name) == name


@cases(
    "name",
    [
        "",
        "/",
        "a/",
        "/a/",
        "//a",
        "a//b",
        "1a",
        "a/1b",
        "a b",
        "a-b",
        "é",
        "~a",
        "/~/a",
        "a__b",
        "a" * 257,
        "a\n",
        None,
    ],
)
def test_bad_topics(name: str) -> None:
    with pytest.raises(NameError_):
        names.validate_topic(name)


@cases("name", ["talker", "_t", "T1"])
def test_good_nodes(name: str) -> None:
    assert names.validate_node(name) == name


@cases("name", ["", "a/b", "/a", "1a", "a b", "a\n"])
def test_bad_nodes(name: str) -> None:
    with pytest.raises(NameError_):
        names.validate_node(name)


@cases("name", ["/", "/a", "/a/b"])
def test_good_namespaces(name: str) -> None:
    assert names.validate_namespace(name) == name


@cases("name", ["", "a", "/a/", "//", "/1", "~"])
def test_bad_namespaces(name: str) -> None:
    with pytest.raises(NameError_):
        names.validate_namespace(name)


@cases(
    ("name", "namespace", "expected"),
    [
        ("odom", "/", "/odom"),
        ("odom", "/sim_1", "/sim_1/odom"),
        ("/odom", "/sim_1", "/odom"),
        ("~/resume", "/sim_1", "/sim_1/base/resume"),
        ("~/resume", "/", "/base/resume"),
        ("~", "/sim_1", "/sim_1/base"),
        ("a/b", "/x/y", "/x/y/a/b"),
    ],
)
def test_resolve(name: str, namespace: str, expected: str) -> None:
    assert names.resolve(name, namespace, "base") == expected


def test_a_full_name_has_its_limit_too() -> None:
    with pytest.raises(NameError_, match="at most 256"):
        names.resolve("b" * 200, "/" + "a" * 100, "n")
