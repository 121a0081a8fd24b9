"""sim, play and driver as commands; what they simulate, replay and see is tested beside their packages."""

from __future__ import annotations

import json
import signal
import subprocess
from pathlib import Path

import pytest

from tests.metaros.cli.conftest import Run, assert_reported
from tests.support.processes.command_line import call_metaros, program
from tests.support.processes.processes import END_S, started
from tests.support.waiting import wait_until


@pytest.mark.parametrize(
    ("command", "stop"),
    [
        (("sim", "--robots", "1", "--first", "7", "--no-camera"), signal.SIGTERM),
        (("driver", "run", "camera", "--param", "source=test", "--namespace", "/desk"), signal.SIGINT),
    ],
)
def test_it_runs_until_reported_to_stop(
    zenoh_port: str, tmp_path: Path, command: tuple[str, ...], stop: signal.Signals
) -> None:
    status = tmp_path / "status.json"
    argv = program(*command, "--zenoh-port", zenoh_port, "--status-file", str(status))
    with started(argv, stderr=subprocess.STDOUT) as process:
        wait_until(lambda: status.exists() or process.poll() is not None)
        assert process.poll() is None, process.communicate()[0]
        assert json.loads(status.read_text())["pid"] == process.pid
        process.send_signal(stop)
        out, _ = process.communicate(timeout=END_S)
    assert process.returncode == 0, out
    assert out.splitlines()[-1] == "stopped"


def test_driver_list() -> None:
    assert "camera" in [row["kind"] for row in json.loads(call_metaros("driver", "list", "-o", "json").out)]


def test_what_cannot_be_is_one_line_and_exit_code_2(run: Run) -> None:
    table = {
        ("driver", "run", "toaster"): (2, "camera"),
        ("driver", "run", "camera", "--param", "source"): (2, "NAME=VALUE"),
        ("driver", "run", "camera", "--param", "sauce=0"): (2, "sauce"),
        ("sim", "--fault", "nonsense"): (2, "nonsense"),
        ("play", "/no/such/file.clf"): (2, "/no/such/file.clf"),
    }
    assert_reported(run, table)
