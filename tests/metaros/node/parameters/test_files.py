"""ROS 2 parameter files: wildcards, nesting, YAML as ROS reads it, and values that survive a dump."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from metaros.errors import ConfigError
from metaros.node.parameters import NodeParameters
from metaros.node.parameters.files import dump_yaml, load_file, load_text, parse_value

# a busy machine is no fault of the code
unhurried = settings(deadline=None, max_examples=50, suppress_health_check=[HealthCheck.too_slow])

FILE = """
/**:
  ros__parameters: {a: 1, who: everyone}
/sim_1/base:
  ros__parameters:
    who: base
    motor: {gain: 1e-3, limits: [1.0, 2]}
    motor.name: left
/sim_1/*:
  ros__parameters: {star: true}
/**/base:
  ros__parameters: {deep: yes}
/sim_*/base:
  ros__parameters: {part: 1}
sim_1:
  base:
    ros__parameters: {joined: '1'}
other:
  ros__parameters: {b: 2}
"""


def test_names_and_wildcards_choose_the_node_and_the_last_one_wins():
    assert load_text(FILE, "/sim_1/base") == {
        "a": 1,
        "who": "base",
        "motor.gain": 0.001,
        "motor.limits": [1.0, 2.0],
        "motor.name": "left",
        "star": True,
        "deep": True,
        "part": 1,
        "joined": "1",
    }
    assert load_text(FILE, "/other") == {"a": 1, "who": "everyone", "b": 2}
    assert load_text(FILE, "/x/y/base") == {"a": 1, "who": "everyone", "deep": True}
    assert load_text(FILE, "/other", wildcards=False) == {"b": 2}
    assert load_text("", "/n") == {}
    assert load_text("n: {ros__parameters: }", "/n") == {}


TWICE = """
/**:
  ros__parameters: {a: first, b: first}
/*:
  base: {ros__parameters: {a: second, group: {x: 1}}}
/**:
  base: {ros__parameters: {c: third, group: {y: 2}, group: {z: 3}}}
  ros__parameters: {b: third}
  ros__parameters: {d: fourth}
"""


def test_names_that_stand_there_twice_count_twice():
    assert load_text(TWICE, "/base") == {
        "a": "first",
        "b": "third",
        "c": "third",
        "group.y": 2,
        "group.z": 3,
        "d": "fourth",
    }
    assert load_text(TWICE, "/x/base")["group.x"] == 1
    merged = "common: &c {ros__parameters: {a: 1}}\nn: {<<: *c}\n"
    assert load_text(merged, "/n") == {"a": 1}


def test_scalars_are_what_ros_makes_of_them():
    cases = {
        "1e3": 1000.0,
        "1:30": "1:30",
        "2024-01-01": "2024-01-01",
        "0x10": 16,
        "on": True,
        "~": None,
        "-.5": -0.5,
        ".inf": float("inf"),
    }
    assert {text: parse_value(text) for text in cases} == cases
    assert parse_value("[unclosed") == "[unclosed"


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("a: [", "no YAML"),
        ("just text", "must hold node names"),
        ("n: 3", "ros__parameters: is missing"),
        ("n: {ros__parameters: 3}", "must hold names and values"),
        ("n: {ros__parameters: {a: [1, b]}}", "a: .*no parameter value"),
        ("n: {ros__parameters: {a: 99999999999999999999}}", "64 bits"),
        ("n: " + "{a: " * 40 + "{}" + "}" * 40, "must hold node names"),
    ],
)
def test_what_is_no_parameter_file_says_why(text, why):
    with pytest.raises(ConfigError, match=why):
        load_text(text, "/n")


def test_missing_files_say_so(tmp_path):
    with pytest.raises(ConfigError, match="No such file"):
        load_file(tmp_path / "none.yaml", "/n")


value = st.one_of(
    st.booleans(),
    st.integers(-(1 << 63), (1 << 63) - 1),
    st.floats(),
    st.text(),
    st.binary(),
    st.lists(st.booleans(), min_size=1),
    st.lists(st.integers(-9, 9), min_size=1),
    st.lists(st.floats(), min_size=1),
    st.lists(st.text(), min_size=1),
)
name = st.one_of(
    st.text(st.sampled_from("ab.1"), min_size=1, max_size=6),
    st.sampled_from(["true", "1", "~", "<<", "ros__parameters", "ä ö", "=", "a: b", "-", "null"]),
)


@unhurried
@given(st.dictionaries(name, value, max_size=8))
def test_every_dump_loads_again(values):
    np.testing.assert_equal(load_text(dump_yaml("/ns/node", values), "/ns/node"), values)


def test_a_dump_nests_names_as_ros2_does():
    text = dump_yaml("/robot", {"speed": 0.5, "motor.gain": 1.0, "motor.name": "l", "a": 1, "a.b": 2})
    assert text.splitlines()[:2] == ["/robot:", "  ros__parameters:"]
    assert "motor: {gain: 1.0, name: l}" in text
    assert "a.b: 2" in text


def test_a_node_dumps_and_loads_itself(tmp_path):
    first, second = NodeParameters("/robot"), NodeParameters("/robot")
    for parameters in (first, second):
        parameters.declare("speed", 0.5)
        parameters.declare("tags", ["a"])
    first.set_atomically({"speed": 0.25, "tags": ["b", "c"]})
    path = tmp_path / "robot.yaml"
    path.write_text(first.dump())
    second.load(path)
    assert second.values() == first.values()
