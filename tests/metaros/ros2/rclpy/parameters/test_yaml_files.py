"""Parameter files: which sections count for which nodes, in which order, and what becomes of their values."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from metaros.ros2.rclpy.parameters.parameter import parameter_dict_from_yaml_file, parameter_value_to_python

FILE = """
/base: {ros__parameters: {a: 1}}
base: {ros__parameters: {b: 2}}
/arm: {base: {ros__parameters: {c: 3}}}
/**: {ros__parameters: {every: true, a: 0}}
/*/base: {ros__parameters: {one_up: true}}
/**/base: {ros__parameters: {some_up: true}}
/x/y/base: {ros__parameters: {deep: true}}
"""


def names(file: Path, **options: Any) -> str:
    return " ".join(sorted(parameter_dict_from_yaml_file(str(file), **options)))


def test_which_sections_count(tmp_path: Path) -> None:
    file = tmp_path / "parameters.yaml"
    file.write_text(FILE)
    assert names(file) == "a b c deep"
    assert names(file, use_wildcard=True) == "a b c deep every one_up some_up"
    assert names(file, target_nodes=["base"]) == names(file, target_nodes=["/base"]) == "a b"
    assert names(file, target_nodes=["/arm/base"]) == "c"
    assert names(file, target_nodes=["/arm/base"], use_wildcard=True) == "a c every one_up some_up"
    assert names(file, target_nodes=["/x/y/base"], use_wildcard=True) == "a deep every some_up"
    assert names(file, target_nodes=["/x/y/base"], namespace="sub.") == "sub.deep"
    with pytest.raises(RuntimeError, match=r"does not contain any valid parameters.* for lidar; it names /base, "):
        names(file, target_nodes=["lidar"])


def test_what_names_a_node_wins_over_wildcards(tmp_path: Path) -> None:
    file = tmp_path / "parameters.yaml"
    file.write_text(FILE)
    found = parameter_dict_from_yaml_file(str(file), use_wildcard=True, target_nodes=["/base"])
    assert (found["a"].name, parameter_value_to_python(found["a"].value)) == ("a", 1)


def test_values(tmp_path: Path) -> None:
    file = tmp_path / "parameters.yaml"
    file.write_text(
        "n: {ros__parameters: {motor: {gain: 1e-3, name: '7'}, list: [1, 2.5], none: null, raw: !!binary YQ==}}"
    )
    found = parameter_dict_from_yaml_file(str(file))
    assert {name: parameter_value_to_python(message.value) for name, message in found.items()} == {
        "motor.gain": 0.001,
        "motor.name": "7",
        "list": [1.0, 2.5],
        "raw": [b"a"],
    }


def test_files_that_are_none(tmp_path: Path) -> None:
    file = tmp_path / "parameters.yaml"
    with pytest.raises(FileNotFoundError):
        names(file)
    for text in (
        "a: 1",
        "[1]",
        "n: {parameters: 1}",
        "n: {ros__parameters: [1]}",
        "n: {ros__parameters: {a: [1, b]}}",
        "{",
    ):
        file.write_text(text)
        with pytest.raises(RuntimeError, match="invalid structure of the parameter file"):
            names(file)
    file.write_text("")
    with pytest.raises(RuntimeError, match="it names no node"):
        names(file)
