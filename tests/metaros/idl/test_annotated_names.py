"""Where the package of a `@message` class comes from, and field names."""

from __future__ import annotations

import runpy
import sys
from pathlib import Path

import pytest

from metaros.errors import FieldError
from metaros.idl.annotated_names import field_name, is_constant_name, type_name
from tests.support.tables import cases

PROGRAM = "import metaros\n\n@metaros.message\nclass Thing:\n    x: int = 0\n"


@pytest.mark.parametrize(
    ("file", "package"),
    [
        ("talker.py", "talker"),
        ("My-Robot.v2.py", "my_robot_v2"),
        ("2nd__try_.py", "pkg_2nd_try"),
        ("émoji.py", "moji"),
        ("___.py", "pkg"),
    ],
)
def test_of_a_program_it_is_the_files_name(tmp_path: Path, file: str, package: str) -> None:
    script = tmp_path / file
    script.write_text(PROGRAM)
    made = runpy.run_path(str(script), run_name="__main__")["Thing"]
    assert made.__metaros_name__ == f"{package}/msg/Thing"


def test_of_a_module_run_with_dash_m_it_is_its_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "my_fleet_pkg").mkdir()
    (tmp_path / "my_fleet_pkg" / "__init__.py").touch()
    (tmp_path / "my_fleet_pkg" / "talker.py").write_text(PROGRAM)
    monkeypatch.syspath_prepend(str(tmp_path))
    made = runpy.run_module("my_fleet_pkg.talker", run_name="__main__", alter_sys=True)["Thing"]
    assert made.__metaros_name__ == "my_fleet_pkg/msg/Thing"
    sys.modules.pop("my_fleet_pkg", None)


def test_in_an_interpreter_it_is_interactive(monkeypatch: pytest.MonkeyPatch) -> None:
    main = type(sys)("__main__")
    monkeypatch.setitem(sys.modules, "__main__", main)
    assert type_name(type("Thing", (), {"__module__": "__main__"}), "") == "interactive/msg/Thing"


@cases(("attribute", "name"), [("x", "x"), ("from_", "from"), ("a1_b2", "a1_b2"), ("type", "type")])
def test_fields_keep_their_names(attribute: str, name: str) -> None:
    assert field_name(attribute) == name


@cases("attribute", ["X", "_x", "x_", "x__y", "é", "1x", "myField", "a" * 200])
def test_names_that_ros_does_not_allow(attribute: str) -> None:
    with pytest.raises(FieldError, match="the name is illegal in ROS"):
        field_name(attribute)


@cases("name", ["Robot/msg/Thing", "r/srv/Thing", "r/msg/thing", "r__x/msg/Thing", "r/msg/Th_ing", "/"])
def test_type_names_that_ros_does_not_allow(name: str) -> None:
    with pytest.raises(FieldError, match="is no message name"):
        type_name(int, name)


def test_constants_are_in_capitals() -> None:
    assert [name for name in ("MAX", "MAX_2", "Max", "max", "_MAX", "MAX__A") if is_constant_name(name)] == [
        "MAX",
        "MAX_2",
    ]
