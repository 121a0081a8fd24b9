"""The loader with agents that do badly: real processes, each a small script in the place of a slot's interpreter."""

from __future__ import annotations

import os
import signal
import sys
from pathlib import Path

import pytest

from edge_agent.update.loader import Loader, state_dir_of
from edge_agent.update.restart import LOADER_ENV, LoaderInfo, loader_info
from edge_agent.update.slots import Slots, python_of
from tests.support.processes.processes import END_S, alive, started
from tests.support.waiting import wait_until

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="a script in the place of an interpreter")

BEGIN = """#!{python} {option}
import os, signal, sys, time
from pathlib import Path
state = Path({state!r})
with (state / "log").open("a") as file:
    file.write("{version} %d\\n" % os.getpid())
"""
KEEP = """
from edge_agent.update.slots import Slots
slots = Slots(state)
if slots.read().probing:
    slots.mark_good()
    sys.exit(75)
"""
HANG = "signal.signal(signal.SIGTERM, lambda *_: sys.exit(0)); time.sleep(600)"
DEAF = "signal.signal(signal.SIGTERM, signal.SIG_IGN); time.sleep(600)"
PROGRAM = """
import sys
from pathlib import Path
import edge_agent.update.loader as boot
boot.GRACE_S = boot.PAUSE_S = 0.0
boot.STOP_S = 0.2
state, link_s = Path(sys.argv[1]), float(sys.argv[2])

class Impatient(boot.SystemClock):
    def monotonic_s(self):  # for `link_s` 0: all its time is over once an agent has been started
        return 1e9 * (state / "log").exists()

clock = boot.SystemClock() if link_s else Impatient()
sys.exit(boot.Loader(state_dir=state, arguments=(), health_s=0.2, link_s=link_s, boots=2).run(clock))
"""


def install(state: Path, version: str, script: str) -> Slots:
    """A version whose agent is that script, on trial."""
    slots = Slots(state)
    folder = slots.empty_one()
    python = python_of(folder)
    python.parent.mkdir(parents=True)
    option = "" if "edge_agent" in script else "-S"  # which starts in half the time
    python.write_text(BEGIN.format(python=sys.executable, option=option, state=str(state), version=version) + script)
    python.chmod(0o700)
    slots.seal(folder, {"version": version})
    slots.switch(folder, version)
    return slots


def prepare(state: Path, script: str, old: str = "sys.exit(7)") -> Slots:
    """2.0.0 was kept, and 2.1.0 is on trial."""
    install(state, "2.0.0", old).mark_good()
    return install(state, "2.1.0", script)


def program(state: Path, link_s: float) -> list[str]:
    return [sys.executable, "-c", PROGRAM, str(state), str(link_s)]


def run(state: Path, link_s: float = 30.0) -> int:
    """The loader until it ends."""
    with started(program(state, link_s)) as process:
        return process.wait(END_S)


def log(state: Path) -> list[str]:
    """The versions that were started."""
    path = state / "log"
    return [line.split()[0] for line in path.read_text().splitlines()] if path.exists() else []


@pytest.mark.parametrize(
    "script", ["sys.exit(1)", "sys.exit(0)", "sys.exit(75)", "os.kill(os.getpid(), 9)", "syntax error"]
)
def test_an_agent_that_ends_at_its_start_is_taken_back(tmp_path: Path, script: str) -> None:
    slots = prepare(tmp_path, script)
    assert run(tmp_path) == 7  # that of the old one, which is the program now
    assert log(tmp_path) in (["2.1.0", "2.1.0", "2.0.0"], ["2.0.0"])
    current = slots.read()
    assert (current.version, current.state, current.failed_version) == ("2.0.0", "good", "2.1.0")


@pytest.mark.parametrize("script", [HANG, DEAF], ids=["hang", "deaf"])
def test_an_agent_that_hangs_is_taken_back(tmp_path: Path, script: str) -> None:
    slots = prepare(tmp_path, script)
    assert run(tmp_path, link_s=0.0) == 7
    assert log(tmp_path) == ["2.1.0", "2.0.0"]
    assert "hung" in slots.read().failed_reason


def test_an_agent_that_cannot_even_be_executed_is_taken_back(tmp_path: Path) -> None:
    slots = prepare(tmp_path, "")
    python_of(slots.path("b")).write_bytes(b"\x7fELF")
    assert run(tmp_path) == 7
    assert log(tmp_path) == ["2.0.0"]
    assert slots.read().failed_version == "2.1.0"


def test_an_agent_that_is_kept_takes_the_process_over(tmp_path: Path) -> None:
    slots = prepare(tmp_path, KEEP + "sys.exit(5)")
    with started(program(tmp_path, 30.0)) as process:
        assert process.wait(END_S) == 5
    lines = [line.split() for line in (tmp_path / "log").read_text().splitlines()]
    assert [version for version, _ in lines] == ["2.1.0", "2.1.0"]
    assert int(lines[1][1]) == process.pid
    assert slots.read().state == "good"


def test_sigterm_ends_an_agent_on_trial_and_counts_for_nothing(tmp_path: Path) -> None:
    slots = prepare(tmp_path, HANG)
    with started(program(tmp_path, 600.0)) as process:
        wait_until(lambda: log(tmp_path) == ["2.1.0"])
        assert slots.read().boots == 1
        process.terminate()
        process.wait(END_S)
    assert (slots.read().boots, slots.read().version, slots.read().probing) == (0, "2.1.0", True)


@pytest.mark.skipif(sys.platform != "linux", reason="the parent-death signal")
def test_kill_9_of_the_loader_takes_the_agent_on_trial_with_it(tmp_path: Path) -> None:
    """And its starts are counted over it: a loader that systemd starts again goes back in the end."""
    slots = prepare(tmp_path, DEAF)
    for count in (1, 2):
        with started(program(tmp_path, 600.0)) as process:
            wait_until(lambda: len(log(tmp_path)) == count)  # noqa: B023 - called at once
            child = int((tmp_path / "log").read_text().split()[-1])
            process.send_signal(signal.SIGKILL)
            process.wait(END_S)
        wait_until(lambda: not alive(child))  # noqa: B023 - called at once
    assert run(tmp_path) == 7
    assert slots.read().failed_version == "2.1.0"


def test_a_second_loader_does_not_count_the_starts_of_the_first(tmp_path: Path) -> None:
    slots = prepare(tmp_path, HANG)
    with started(program(tmp_path, 600.0)):
        wait_until(lambda: log(tmp_path) == ["2.1.0"])
        with started(program(tmp_path, 600.0)) as second:
            assert second.wait(END_S) == 1
            assert second.stderr is not None
            assert "another metaros agent-slot" in second.stderr.read()
        assert slots.read().boots == 1


def test_what_the_agent_is_reported(tmp_path: Path) -> None:
    loader = Loader(state_dir=tmp_path, arguments=("--name", "r"), health_s=1.5, link_s=3.0, boots=2)
    slots = prepare(tmp_path, "")
    environ = loader.environment(slots.read(), watcher=7)
    found = loader_info(environ)
    assert found == LoaderInfo(loader=found.loader if found else (), watcher=7, health_s=1.5, link_s=3.0)
    assert found.loader[-3:] == ("--", "--name", "r")
    assert loader_info({}) is None
    assert loader_info({LOADER_ENV: "{}"}) is None
    assert loader.command(slots, slots.read())[-3:] == ["agent", "--name", "r"]


def test_the_state_directory_is_found_as_the_agent_finds_it(tmp_path: Path) -> None:
    config = tmp_path / "agent.toml"
    config.write_text(f'name = "c3"\nstate_dir = "{tmp_path.as_posix()}/there"\nunknown_to_this_version = 1\n')
    assert state_dir_of(None, None, config) == tmp_path / "there"
    assert state_dir_of("x", tmp_path / "told", config) == tmp_path / "told"
    assert state_dir_of("x", None, None).parts[-3:] == (".metaros", "agent", "x")
    assert os.path.isabs(state_dir_of(None, Path("relative"), None))
