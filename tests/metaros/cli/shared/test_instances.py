"""Claims of running instances: seen while they live, forgotten at any kind of death."""

from __future__ import annotations

import os
import subprocess
import sys
from contextlib import AbstractContextManager
from pathlib import Path

import pytest

from metaros.cli.shared.instances import (
    Instance,
    StateFile,
    claim_lock,
    data_root,
    open_data_dir,
    running_instances,
    runtime_dir,
)
from metaros.errors import ConfigError
from tests.support.processes.processes import END_S, started
from tests.support.waiting import wait_until

HOLDER = """
import sys
from pathlib import Path
from metaros.cli.shared.instances import Instance, StateFile, open_data_dir
state = StateFile()
state.write(Instance(pid=1, state="ready", http_port=8080, robots=("sim_1",), started_ns=int(sys.argv[1])))
data = open_data_dir(None)
print(data.path, flush=True)
sys.stdin.read()
"""


@pytest.fixture(autouse=True)
def own_places(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """State and data of this test only."""
    monkeypatch.setenv("METAROS_RUNTIME_DIR", str(tmp_path / "run"))
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))


def hold(started_ns: int) -> AbstractContextManager[subprocess.Popen[str]]:
    """Another process that runs an instance; its first line is its data directory."""
    return started([sys.executable, "-c", HOLDER, str(started_ns)], stdin=subprocess.PIPE, stderr=None)


def test_an_instance_is_seen_while_it_lives_and_forgotten_after_kill_9() -> None:
    with hold(1) as other:
        assert other.stdout is not None
        other.stdout.readline()
        assert [found.robots for found in running_instances()] == [("sim_1",)]
        other.kill()
        other.wait()
    wait_until(lambda: running_instances() == [])
    assert list(runtime_dir().glob("up-*")) == []


def test_our_own_claim_is_in_the_list_until_closed() -> None:
    state = StateFile()
    state.write(Instance(pid=os.getpid(), state="ready"))
    assert [found.pid for found in running_instances()] == [os.getpid()]
    state.close()
    assert running_instances() == []


def test_a_damaged_state_file_is_left_out() -> None:
    state = StateFile()
    state.write(Instance(pid=os.getpid(), state="ready"))
    (runtime_dir() / f"up-{os.getpid()}.json").write_text("{nonsense")
    assert running_instances() == []
    state.close()


def test_the_second_instance_has_a_directory_of_its_own() -> None:
    with hold(1) as first, hold(2) as second:
        assert first.stdout is not None
        assert second.stdout is not None
        places = {first.stdout.readline().strip(), second.stdout.readline().strip()}
        assert places == {str(data_root()), str(data_root() / "instance-2")}
        third = open_data_dir(None)
        assert third.path == data_root() / "instance-3"
        assert str(data_root()) in third.note
        third.lock.close()
        for process in (first, second):
            process.kill()
            process.wait(END_S)
    again = open_data_dir(None)
    assert (again.path, again.note) == (data_root(), "")
    again.lock.close()


def test_an_explicit_directory_in_use_is_an_error(tmp_path: Path) -> None:
    first = open_data_dir(tmp_path / "mine")
    with pytest.raises(ConfigError, match="in use by another"):
        open_data_dir(tmp_path / "mine")
    first.lock.close()


def test_a_directory_that_cannot_be_is_a_clear_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(ConfigError, match="cannot use the data directory"):
        open_data_dir(tmp_path / "file" / "below")


def test_the_claim_lock_can_be_taken_again() -> None:
    for _ in range(2):
        with claim_lock():
            pass
