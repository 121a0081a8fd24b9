"""Columns, units, and a terminal for real (a pseudo terminal)."""

from __future__ import annotations

import os
import pty
import subprocess

import pytest

from metaros.cli.shared.options import Format
from metaros.cli.shared.output import Output, human_bytes, human_seconds
from tests.support.processes.command_line import program
from tests.support.tables import cases


@cases(
    ("count", "text"),
    [
        (0, "0 B"),
        (999, "999 B"),
        (1000, "1 kB"),
        (1234, "1.23 kB"),
        (123_456, "123 kB"),
        (5_000_000, "5 MB"),
        (3e12, "3e+03 GB"),
    ],
)
def test_bytes_for_people(count: float, text: str) -> None:
    assert human_bytes(count) == text


@cases(("seconds", "text"), [(0.4, "0 s"), (59.9, "59 s"), (61, "1 min 1 s"), (7500, "2 h 5 min")])
def test_ages_for_people(seconds: float, text: str) -> None:
    assert human_seconds(seconds) == text


def test_in_a_pipe_columns_are_plain(capsys: pytest.CaptureFixture[str]) -> None:
    Output().table(("Name", "Type"), [("a", "x"), ("longer", "y")])
    assert capsys.readouterr().out == "a       x\nlonger  y\n"


def test_an_empty_table_is_nothing_in_a_pipe(capsys: pytest.CaptureFixture[str]) -> None:
    Output().table(("Name",), [], empty="nothing here")
    assert capsys.readouterr().out == ""


@cases(("no_color", "styled"), [("", True), ("1", False)])
def test_colours_on_a_terminal_only_and_not_with_no_color(no_color: str, styled: bool) -> None:
    reader, writer = pty.openpty()
    env = {**os.environ, "TERM": "xterm-256color"}
    env.pop("NO_COLOR", None)
    if no_color:
        env["NO_COLOR"] = no_color
    subprocess.run(program("--help"), stdout=writer, env=env, check=True)
    os.close(writer)
    page = os.read(reader, 65536)
    os.close(reader)
    assert b"Meta-ROS" in page
    assert (b"\x1b[" in page) is styled


def test_yaml_is_a_document_and_obeys_nobody(capsys: pytest.CaptureFixture[str]) -> None:
    Output(Format.YAML).objects([{"name": "a", "values": [1, 2.5, None], "text": "größer"}])
    assert capsys.readouterr().out == "- name: a\n  values:\n  - 1\n  - 2.5\n  - null\n  text: größer\n"
    Output(Format.YAML).object_line({"name": "\x1b[2J\u202e"})
    out = capsys.readouterr().out
    assert out.replace("\n", "").isprintable()
    assert out.endswith("\n---\n")
