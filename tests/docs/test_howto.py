"""The how-to pages: every command on them runs, prints what the page shows, and no command lacks a page."""

from __future__ import annotations

import os
import re
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.docs.console import Command, World, commands_of, environment, matches
from tests.layout.test_docs import command_tree

ROOT = Path(__file__).resolve().parents[2]
HOWTO = ROOT / "docs" / "howto"
PAGES = sorted(HOWTO.glob("*.md"))
PERFORMED = {
    "rotate_keys.md"
}  # by tests/security/identity/test_rotation.py, which also looks at what each command does
RUN = [page for page in PAGES if page.name not in PERFORMED and commands_of(page.read_text())]
ALONE = {"run_a_fleet.md"}  # it starts its own robots
NOUNS = "alert backtest|topic|node|service|action|graph|history|top|doctor|launch status|status"
LOOKS = re.compile(rf"metaros ({NOUNS})\b(?! (pub|call|send_goal))")


@pytest.fixture
def world(warm: Path, zenoh_router: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[World]:
    """A router and one simulated robot; the examples are at hand."""
    for name, value in environment(zenoh_router, tmp_path).items():
        monkeypatch.setenv(name, value)
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    monkeypatch.chdir(tmp_path)
    world = World(zenoh_router, tmp_path)
    world.metaros = (str(warm),)
    monkeypatch.setenv("PATH", f"{warm.parent}:{os.environ['PATH']}")
    with world.page():
        yield world


@pytest.mark.integration
@pytest.mark.parametrize("page", [page.name for page in RUN])
def test_every_command_of_the_page_prints_what_it_shows(page: str, world: World) -> None:
    text = (HOWTO / page).read_text()
    if "/sim_1" in text and page not in ALONE:
        world.run(Command(0, "metaros sim --robots 1 &"))
    for command in commands_of(text):
        sample = [line for line in command.sample if line != "^C"]
        printed = printed_by(world, command, sample)
        assert matches(sample, printed), f"{page}:{command.line}: {command.text}\nprinted:\n{printed}"


def printed_by(world: World, command: Command, sample: list[str]) -> str:
    """What it prints; what only looks looks again, since the graph may lag, a topic pause, history be young."""
    until_s = time.monotonic() + (20 if LOOKS.match(command.text) else 0)
    while True:
        try:
            printed = world.run(command)
        except AssertionError:  # a topic that is not there yet
            if time.monotonic() >= until_s:
                raise
            continue
        if matches(sample, printed) or time.monotonic() >= until_s:
            return printed


def test_every_command_has_a_page() -> None:
    text = "\n".join(page.read_text() for page in PAGES)
    said = [f"metaros {' '.join(path)}" for path, _ in command_tree() if path]
    assert [command for command in said if re.search(rf"{command}(?![\w-])", text) is None] == []


def test_the_index_names_every_page() -> None:
    index = (HOWTO / "index.md").read_text()
    assert [page.name for page in PAGES if page.name != "index.md" and f"({page.name})" not in index] == []


def test_what_counts_as_alike() -> None:
    cases = [
        (["rate: 9.998 Hz"], "rate:  10 Hz\n", True),
        (["rate: 9.998 Hz"], "rate: – Hz\n", True),
        (["rate: 9.998 Hz"], "rate: ten Hz\n", False),
        (["15 kB/s"], "122 B/s\n", True),
        (["/sim_1/odom"], "/sim_2/odom\n", False),
        (["a", "…", "b"], "a\nb\n", True),
        (["a", "…", "b"], "a\n1\n2\nb\n", True),
        (["a", "…", "b"], "a\n1\n2\n", False),
        (["a"], "a\nb\n", False),
        (["id … of 3"], "id 0xff of 4\n", True),
        ([], "", True),
        ([], "error: no\n", False),
    ]
    assert [case for case in cases if matches(case[0], case[1]) != case[2]] == []
