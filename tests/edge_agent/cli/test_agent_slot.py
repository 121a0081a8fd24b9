"""`metaros agent-slot`: which options are its own, and whose state it looks after."""

from __future__ import annotations

from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from edge_agent.cli import agent_slot
from edge_agent.update import loader as boot
from edge_agent.update.loader import Loader
from edge_agent.update.slots import Slots
from metaros.concurrency.file_lock import take_lock
from metaros.limits import LIMITS

APP = typer.Typer()
agent_slot.register(APP)
APP.command("other")(lambda: None)  # with one command alone typer has no names


@pytest.fixture
def loaders(monkeypatch: pytest.MonkeyPatch) -> list[Loader]:
    """Those that would have run: they become the agent's process."""
    made: list[Loader] = []

    def run(loader: Loader) -> int:
        made.append(loader)
        return 7

    monkeypatch.setattr(boot.Loader, "run", run)
    return made


@pytest.mark.parametrize(
    ("arguments", "state"),
    [
        (["--name", "arm", "--state-dir", "first", "--state-dir=last"], "last"),
        (["--state-dir=first", "--state-dir", "last"], "last"),
        (["--config", "robot.toml"], "of_the_file"),
        (["--config=robot.toml", "--state-dir", "told"], "told"),
        (["--state-directory=no", "--config", "robot.toml"], "of_the_file"),
        (["--config", "robot.toml", "--state-dir"], "of_the_file"),
    ],
)
def test_the_agents_own_options_say_whose_state_it_is(
    loaders: list[Loader],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    arguments: list[str],
    state: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("robot.toml").write_text('state_dir = "of_the_file"\n')
    done = CliRunner().invoke(APP, ["agent-slot", "--boots", "2", "--health-s", "5", *arguments])
    assert (done.exit_code, done.output) == (7, "")
    assert loaders == [
        Loader(
            state_dir=tmp_path / state, arguments=tuple(arguments), health_s=5.0, link_s=LIMITS.update_link_s, boots=2
        )
    ]


@pytest.mark.parametrize("option", [["--name", "arm"], ["--name=arm"]])
def test_without_a_directory_the_name_says_it(
    loaders: list[Loader], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, option: list[str]
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    assert CliRunner().invoke(APP, ["agent-slot", *option]).exit_code == 7
    assert loaders[0].state_dir == boot.default_state_dir("arm")
    assert loaders[0].arguments == tuple(option)


def test_what_keeps_it_from_running_is_said(tmp_path: Path) -> None:
    folder = Slots(tmp_path).folder
    folder.mkdir(parents=True)
    with (folder / "lock").open("w") as file:
        assert take_lock(file.fileno())
        done = CliRunner().invoke(APP, ["agent-slot", "--state-dir", str(tmp_path)])
    assert done.exit_code == 2
    assert done.stderr == f"metaros agent-slot: another metaros agent-slot watches an agent in {tmp_path}\n"
