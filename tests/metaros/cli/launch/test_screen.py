"""What `metaros launch` shows."""

from __future__ import annotations

import io
from pathlib import Path

import pytest

from metaros.cli.launch.screen import Screen
from metaros.clock import ManualClock
from metaros.supervise import Event, EventKind, ProcessStatus
from metaros.supervise.launch_table import parse_table

TABLE = '[[node]]\nname = "camera"\nmodule = "m"\n[[node]]\nname = "b"\nmodule = "m"\n'


@pytest.fixture
def clock() -> ManualClock:
    return ManualClock()


@pytest.fixture
def screen(clock: ManualClock) -> Screen:
    return Screen(parse_table(TABLE, Path("/x/robot.toml")), clock=clock)


def test_lines_stand_under_their_node_and_cannot_rewrite_the_terminal(
    screen: Screen, capsys: pytest.CaptureFixture[str]
) -> None:
    screen.line("camera", "[bold]hello[/] \x1b[2J")
    screen.line("b", "there")
    assert capsys.readouterr().out == "camera │ [bold]hello[/] ·[2J\nb      │ there\n"


def test_of_a_flood_only_the_beginning_is_shown(
    screen: Screen, clock: ManualClock, capsys: pytest.CaptureFixture[str]
) -> None:
    for number in range(1000):
        screen.line("b", str(number))
    clock.advance(1.0)
    screen.refresh([])
    screen.line("b", "again")
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 52
    assert lines[-2:] == ["b      │ … 950 more lines, in its log", "b      │ again"]


def test_a_death_is_reported_with_its_last_lines_unless_they_are_its_reason(
    screen: Screen, capsys: pytest.CaptureFixture[str]
) -> None:
    screen.event(Event(name="b", kind=EventKind.EXITED, detail="killed by SIGKILL"), ["one", "two"])
    screen.event(Event(name="b", kind=EventKind.EXITED, detail="exit code 1: two"), ["one", "two"])
    said = capsys.readouterr().out.splitlines()
    assert [line.split(None, 1)[1] for line in said] == [
        "■ killed by SIGKILL",
        "last: one",
        "last: two",
        "■ exit code 1: two",
    ]


def test_the_table_says_how_each_node_is(screen: Screen) -> None:
    from rich.console import Console

    row = {"pid": None, "restarts": 3, "last_exit": "exit code 1"}
    rows = [
        ProcessStatus(name="camera", state="running", pid=None, restarts=0, last_exit="", critical=True, ready=True),
        ProcessStatus(name="b", state="blocked", waits_for="camera", **row),  # type: ignore[arg-type]
    ]
    screen._rows = rows
    console = Console(width=100, record=True, file=io.StringIO())
    console.print(screen._view())
    text = console.export_text()
    assert "camera ★   ● running" in text
    assert "◌ waits for camera" in text
    assert "exit code 1" in text
