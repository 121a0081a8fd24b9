"""`check_fields=True` and ROS_PYTHON_CHECK_FIELDS=1: what is refused where it is set, and what is not."""

from __future__ import annotations

from array import array
from collections import UserList, UserString
from typing import Any

import numpy as np
import pytest

from metaros.cdr import codec
from metaros.idl import Catalogue, parse_msg
from metaros.idl.catalogue import default_catalogue
from metaros.ros2.rosidl.catalogue import interface

TEXT = """
bool a
byte b
char c
int8 d
uint64 e
float32 f
float64 g
string h
string<=3 i
std_msgs/String j
bool[2] k
byte[] l
int16[<=2] m
float32[3] n
string<=3[] o
std_msgs/String[<=1] p
uint8[] q
"""


def make() -> Any:
    catalogue = Catalogue(base=default_catalogue())
    catalogue.add(parse_msg(TEXT, "p/msg/N"))
    return interface("p/msg/N", catalogue)


def text() -> Any:
    return interface("std_msgs/msg/String")(data="x")


def test_good_and_bad_values() -> None:
    over32 = float(np.nextafter(3.402823466e38, np.inf))
    good: dict[str, list[Any]] = {
        "a": [True],
        "b": [b"2", bytearray(1)],
        "c": [0, 255],
        "d": [-128, 127, True],
        "e": [0, 2**64 - 1],
        "f": [1.5, float("nan"), float("-inf"), np.float64(2)],
        "g": [1.5, float("inf")],
        "h": ["any"],
        "i": ["abc", UserString("abc")],
        "j": [text()],
        "k": [[True, False]],
        "l": [[b"a", b"b"], b"ab"],
        "m": [[1, -5], (3,), {4}, UserList([1]), array("h", [1, 2]), []],
        "n": [[1.0, 2.0, 3.0], np.zeros(3, np.float32)],
        "o": [["abc"], []],
        "p": [[text()], []],
        "q": [b"abc", [0, 255], array("B", [1])],
    }
    bad: dict[str, list[Any]] = {
        "a": [1, None],
        "b": [2, b"22", "2"],
        "c": [256, -1, "c"],
        "d": [128, -129, 1.0],
        "e": [-1, 2**64],
        "f": [1, "1.0", over32, -over32],
        "g": [1],
        "h": [1, b"x"],
        "i": ["abcd", UserString("abcd")],
        "j": ["x", None],
        "k": [[True], ["x", "y"], True],
        "l": [["a"], [1, b"2"]],
        "m": [[1, 2, 3], array("h", [1, 2, 3]), array("i", [1]), [40000], "ab", [1.5], 5],
        "n": [[1.0], np.zeros(2, np.float32), np.zeros(3), [1.0, 2.0, over32], [1, 2, 3]],
        "o": [["abcd"], "abc"],
        "p": [[text(), text()], ["x"]],
        "q": [[256], [-1], ["x"], array("b", [1])],
    }
    message, wrong = make()(check_fields=True), []
    for name, values in good.items():
        for value in values:
            try:
                setattr(message, name, value)
            except AssertionError as error:
                wrong.append(f"{value!r} is refused: {error}")
    for name, values in bad.items():
        for value in values:
            try:
                setattr(message, name, value)
            except AssertionError as error:
                wrong += [] if repr(name) in str(error) else [f"{error} does not name {name}"]
            else:
                wrong.append(f"{name} takes {value!r}")
    assert not wrong
    message.i = "abc"
    assert codec(type(message)).decode(codec(type(message)).encode(message)).q.tolist() == [1]


def test_constructor_checks_when_asked() -> None:
    cls = make()
    with pytest.raises(AssertionError, match=r"'d' .* between -128 and 127, not 300"):
        cls(d=300, check_fields=True)
    assert cls(d=300).d == 300
    assert cls(d=300, check_fields=False).d == 300
    checked = cls(d=3, check_fields=True)
    assert (isinstance(checked, cls), checked == cls(d=3), cls(d=3) == checked) == (True, True, True)
    assert (type(checked).__name__, type(checked).__module__, checked._check_fields) == ("N", "p.msg._n", True)
    assert repr(checked) == repr(cls(d=3))
    assert codec(cls).encode(checked) == codec(cls).encode(cls(d=3))


def test_environment_makes_it_the_rule(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_PYTHON_CHECK_FIELDS", "1")
    cls = make()
    with pytest.raises(AssertionError):
        cls(d=300)
    assert cls(d=300, check_fields=False).d == 300


def test_subclasses_of_programs_check_too() -> None:
    class Own(interface("std_msgs/msg/String")):  # type: ignore[misc]
        pass

    own = Own(check_fields=True)
    with pytest.raises(AssertionError):
        own.data = 3
    own.other = 3
    assert isinstance(own, Own)
