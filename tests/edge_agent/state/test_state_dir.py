"""One agent a directory, whatever happens to the one before."""

from __future__ import annotations

import os
import signal
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from edge_agent.errors import DiskError
from edge_agent.identity.files import IdentityFiles
from edge_agent.state.state_dir import default_state_dir, locked
from metaros.errors import ConfigError

HOLD = """
import sys
from pathlib import Path
from edge_agent.state.state_dir import locked
with locked(Path(sys.argv[1])):
    print("held", flush=True)
    sys.stdin.read()
"""


def test_it_is_made_and_held(tmp_path: Path) -> None:
    directory = tmp_path / "a" / "b"
    for _ in range(2):
        with locked(directory):
            assert directory.is_dir()
            refusal = rf"process {os.getpid()}\) uses .*\n.*--state-dir"
            with pytest.raises(ConfigError, match=refusal), locked(directory):
                pass


@pytest.mark.skipif(sys.platform == "win32", reason="modes are Unix's")
def test_nobody_else_reads_what_the_robot_holds(tmp_path: Path) -> None:
    with locked(tmp_path / "agent"):
        assert stat.S_IMODE((tmp_path / "agent").stat().st_mode) == 0o700
    IdentityFiles(tmp_path / "enrolled").pending_key("token 1 arm")  # enrolment comes before the first start
    assert stat.S_IMODE((tmp_path / "enrolled").stat().st_mode) == 0o700


def test_another_process_is_named_and_its_death_frees_the_directory(tmp_path: Path) -> None:
    holder = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(tmp_path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    try:
        assert holder.stdout is not None
        assert holder.stdout.readline() == "held\n"
        with pytest.raises(ConfigError, match=rf"process {holder.pid}\)"), locked(tmp_path):
            pass
        holder.send_signal(signal.SIGTERM if os.name == "nt" else signal.SIGKILL)
        holder.wait(60)
        with locked(tmp_path):
            assert (tmp_path / "lock").read_text() == str(os.getpid())
    finally:
        holder.kill()
        holder.communicate()


def test_a_directory_that_cannot_be_made_is_an_error_of_the_disk(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(DiskError, match="cannot use"), locked(tmp_path / "file" / "state"):
        pass


def test_the_default_is_in_the_users_home() -> None:
    assert default_state_dir("sim_1") == Path.home() / ".metaros" / "agent" / "sim_1"
