"""`metaros interface`: the catalogue in words, and its errors."""

from __future__ import annotations

import io
import json
from contextlib import redirect_stderr, redirect_stdout

import pytest
import yaml

from metaros.cli.main import main
from metaros.idl import message_class, type_hash
from metaros.idl.json import from_json
from tests.support.tables import cases


def interface(*arguments: str) -> tuple[int, str, str]:
    """Exit code, stdout and stderr."""
    out, err = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(err), pytest.raises(SystemExit) as ended:
        main(["interface", *arguments])
    return int(ended.value.code or 0), out.getvalue(), err.getvalue()


def test_packages_of_a_kind() -> None:
    assert "std_srvs" in interface("packages", "-s")[1].splitlines()
    assert "std_msgs" not in interface("packages", "-s")[1].splitlines()
    assert "example_interfaces" in json.loads(interface("packages", "-a", "-o", "json")[1])


def test_package() -> None:
    assert interface("package", "std_srvs")[1].splitlines() == [
        "std_srvs/srv/Empty",
        "std_srvs/srv/SetBool",
        "std_srvs/srv/Trigger",
    ]


def test_proto_is_a_message_that_can_be_published() -> None:
    code, text, _ = interface("proto", "geometry_msgs/Twist", "--no-quotes")
    assert code == 0
    assert (
        from_json(message_class("geometry_msgs/msg/Twist"), yaml.safe_load(text))
        == message_class("geometry_msgs/msg/Twist")()
    )
    assert interface("proto", "std_srvs/SetBool")[1] == '"data: false\n"\n'
    assert json.loads(interface("proto", "example_interfaces/Fibonacci", "-o", "json")[1]) == {"order": 0}


def test_hash_is_one_word_for_a_message_and_a_table_for_an_action() -> None:
    assert interface("hash", "std_msgs/String")[1].strip() == type_hash("std_msgs/msg/String")
    hashes = json.loads(interface("hash", "example_interfaces/Fibonacci", "-o", "json")[1])
    assert [name.removeprefix("example_interfaces/action/Fibonacci") for name in hashes] == [
        "",
        "_SendGoal",
        "_GetResult",
        "_FeedbackMessage",
    ]


@cases(
    ("arguments", "word"),
    [
        (("package", "std_srv"), "did you mean std_srvs"),
        (("show", "std_msgs/Strng"), "std_msgs/msg/String"),
        (("hash", "std_msgs/Strng"), "std_msgs/msg/String"),
        (("list", "zzz"), "metaros interface packages"),
    ],
)
def test_what_is_not_there_gets_a_hint(arguments: tuple[str, ...], word: str) -> None:
    code, out, err = interface(*arguments)
    assert (code, out) == (2, "")
    assert word in err
