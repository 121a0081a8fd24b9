"""sim, play and driver as commands; what they simulate, replay and see is tested beside their packages."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from metaros.cli.main import main
from tests.metaros.cli.conftest import Run
from tests.support.processes import END_S, started
from tests.support.waiting import wait_until


@pytest.mark.parametrize(
    ("command", "stop"),
    [
        (("sim", "--robots", "1", "--first", "7", "--no-camera"), signal.SIGINT),
        (("sim", "--robots", "1", "--no-camera"), signal.SIGTERM),
        (("driver", "run", "camera", "--param", "source=test", "--namespace", "/desk"), signal.SIGTERM),
    ],
)
def test_it_runs_until_told_to_stop(
    zenoh_router: str, tmp_path: Path, command: tuple[str, ...], stop: signal.Signals
) -> None:
    status = tmp_path / "status.json"
    port = zenoh_router.rsplit(":", 1)[1]
    argv = [sys.executable, "-m", "metaros", *command, "--zenoh-port", port, "--status-file", str(status)]
    with started(argv, stderr=subprocess.STDOUT) as process:
        wait_until(lambda: status.exists() or process.poll() is not None, timeout_s=60)
        assert process.poll() is None, process.communicate()[0]
        assert json.loads(status.read_text())["pid"] == process.pid
        process.send_signal(stop)
        out, _ = process.communicate(timeout=END_S)
    assert process.returncode == 0, out
    assert out.splitlines()[-1] == "stopped"


def test_driver_list(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["driver", "list", "-o", "json"])
    assert "camera" in [row["kind"] for row in json.loads(capsys.readouterr().out)]


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (("driver", "run", "toaster"), "camera"),
        (("driver", "run", "camera", "--param", "source"), "NAME=VALUE"),
        (("driver", "run", "camera", "--param", "sauce=0"), "sauce"),
        (("sim", "--fault", "nonsense"), "nonsense"),
        (("play", "/no/such/file.clf"), "/no/such/file.clf"),
    ],
)
def test_what_cannot_be_is_one_line_and_exit_code_2(run: Run, arguments: tuple[str, ...], word: str) -> None:
    done = run(*arguments)
    assert done.returncode == 2, done.stderr
    assert word in done.stderr
    assert "Traceback" not in done.stderr
