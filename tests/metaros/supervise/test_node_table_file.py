"""The supervisor's table on disk, and what it does not take."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from metaros.errors import ConfigError
from metaros.supervise.node_table_file import Table, TableFile, read_rows
from tests.support.tables import cases


def rows(*names: str, **values: Any) -> list[dict[str, Any]]:
    return [{"name": name, "argv": ["sleep", "9"], **values} for name in names]


def test_what_was_put_there_is_there(tmp_path: Path) -> None:
    file = TableFile(tmp_path / "t.json")
    assert file.table == Table()
    found = read_rows(rows("a", "b", restart="on-failure", nice=5, env={"A": "1"}, stop_grace_s=0.5))
    file.replace(found, frozenset({"a", "gone"}), tag="x")
    again = TableFile(tmp_path / "t.json").table
    assert again == Table(found, frozenset({"a"}), 1, "x")
    file.replace(found[:1], frozenset(), tag="")
    assert TableFile(tmp_path / "t.json").table.version == 2


def test_a_disk_that_refuses_changes_nothing(tmp_path: Path) -> None:
    file = TableFile(tmp_path / "t.json")
    file.replace(read_rows(rows("a")), frozenset(), tag="1")
    (tmp_path / "t.json.tmp").mkdir()
    with pytest.raises(OSError, match=r"t\.json\.tmp"):
        file.replace(read_rows(rows("b")), frozenset(), tag="2")
    assert file.table.tag == "1"
    assert TableFile(tmp_path / "t.json").table.tag == "1"


@pytest.mark.parametrize(
    "text",
    ["", "{", "[]", "{}", '{"format": 2}', '{"format": 1, "rows": 7}', "[" * 100_000, '{"format":1,"rows":[{}]}'],
)
def test_a_damaged_file_is_said(tmp_path: Path, text: str) -> None:
    (tmp_path / "t.json").write_text(text)
    with pytest.raises(ConfigError, match=r"t\.json|name"):
        TableFile(tmp_path / "t.json")


def test_rows_come_in_an_order_in_which_they_start() -> None:
    found = read_rows([*rows("c", after=["b"]), *rows("b", after=["a"]), *rows("a")])
    assert [row.name for row in found] == ["a", "b", "c"]


@cases(
    ("row", "said"),
    [
        ({"name": "a/b"}, "name"),
        ({"name": "a\n"}, "name"),
        ({"argv": []}, "argv"),
        ({"argv": "sleep"}, "argv"),
        ({"argv": ["a\0b"]}, "argv"),
        ({"argv": [""]}, "argv"),
        ({"nice": 40}, "nice: -20 to 19, not 40"),
        ({"nice": True}, "nice"),
        ({"nice": 1.5}, "nice"),
        ({"stop_grace_s": float("nan")}, "stop_grace_s"),
        ({"stop_grace_s": 10**400}, "stop_grace_s"),
        ({"log_bytes": 1}, "log_bytes"),
        ({"restart": "sometimes"}, "restart"),
        ({"restart": ["always"]}, "restart"),
        ({"env": {"A=B": "1"}}, "env"),
        ({"env": {"A": 1}}, "env"),
        ({"run": 1}, "run"),
        ({"after": ["nobody"]}, "nobody"),
        ({"after": ["a"]}, "circle"),
        ({"colour": "red"}, "colour"),
    ],
)
def test_a_row_that_cannot_be_is_refused_by_name(row: dict[str, Any], said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        read_rows([{"name": "a", "argv": ["sleep"], **row}])


@cases("found", [None, {}, "rows", [1], rows("a", "a"), rows(*(f"n{i}" for i in range(257)))])
def test_no_table_at_all(found: object) -> None:
    with pytest.raises(ConfigError):
        read_rows(found)


def test_the_file_is_readable_for_its_user_alone(tmp_path: Path) -> None:
    TableFile(tmp_path / "t.json").replace(read_rows(rows("a")), frozenset(), tag="")
    assert (tmp_path / "t.json").stat().st_mode & 0o077 == 0
    assert json.loads((tmp_path / "t.json").read_text())["rows"][0]["name"] == "a"
