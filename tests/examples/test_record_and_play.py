"""The example of the recorder and the player, and the how-to's commands and program."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import click
import typer

from tests.examples.test_examples import ROOT
from tests.support.processes.command_line import run_metaros
from tests.support.processes.processes import END_S, started


def test_record_and_play(zenoh_router: str, tmp_path: Path) -> None:
    environment = {**os.environ, "METAROS_ZENOH_PORT": zenoh_router.rsplit(":", 1)[1]}
    argv = [sys.executable, "examples/record_and_play.py", str(tmp_path)]
    with started(argv, stderr=subprocess.STDOUT, cwd=ROOT, env=environment) as example:
        said, _ = example.communicate(timeout=END_S)
    assert example.returncode == 0, said
    assert re.search(r"recorded (100|\d\d) messages", said), said
    assert "/position [geometry_msgs/msg/Point]" in said
    assert "to x = 9.9" in said
    assert "heard again" in said
    files = sorted(path.name for path in (tmp_path / "walk").iterdir())
    assert files == ["metadata.yaml", "walk_0.mcap"]
    assert "/position" in run_metaros("bag", "info", str(tmp_path / "walk"))


def blocks(language: str) -> list[str]:
    text = (ROOT / "docs" / "howto" / "record_and_play.md").read_text()
    return re.findall(rf"```{language}\n(.*?)```", text, re.DOTALL)


def test_the_how_to_program_compiles_and_names_what_exists() -> None:
    import metaros.record

    (program,) = blocks("python")
    compile(program, "record_and_play.md", "exec")
    (names,) = re.findall(r"from metaros\.record import (.*)", program)
    assert [name for name in names.split(", ") if not hasattr(metaros.record, name)] == []


def test_the_how_to_commands_are_commands() -> None:
    """Each is parsed as the program would: no unknown option, no missing argument."""
    from metaros.cli.main import build_app

    bag = typer.main.get_command(build_app()).commands["bag"]  # type: ignore[attr-defined]
    lines = [line for block in blocks("") for line in block.splitlines() if line.startswith("metaros bag ")]
    assert len(lines) > 8
    for line in lines:
        words = [word for word in shlex.split(line, comments=True) if word != "&"]
        command = bag.commands[words[2]]
        command.make_context(words[2], words[3:], parent=click.Context(bag))
