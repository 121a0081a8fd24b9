"""The launch tables of the examples, as a user would launch them."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.ports import free_port
from tests.support.waiting import wait_until

ROOT = Path(__file__).resolve().parents[2]
LONG_S = 60.0


def launch(table: str, folder: Path) -> subprocess.Popen[bytes]:
    options = ["--zenoh-port", str(free_port()), "--log-dir", str(folder / "logs")]
    command = [sys.executable, "-m", "metaros", "launch", f"examples/{table}", *options]
    with (folder / "out").open("wb") as out:
        return subprocess.Popen(command, stdout=out, stderr=out, cwd=ROOT)


def test_a_robot_whose_consumer_hears_its_driver(tmp_path: Path) -> None:
    running = launch("robot.toml", tmp_path)
    try:
        wait_until(lambda: "m to the obstacle" in (tmp_path / "out").read_text(), timeout_s=LONG_S)
        text = (tmp_path / "out").read_text()
        assert "[robot.driver]: the front sensor measures 5 times a second" in text
        assert text.index("driver   ▶ started") < text.index("consumer ▶ started")
    finally:
        running.send_signal(signal.SIGINT)
        assert running.wait(LONG_S) == 0


@pytest.mark.slow
def test_a_crash_loop_ends_in_quarantine_and_a_bystander_hears_of_it(tmp_path: Path) -> None:
    running = launch("crash_loop.toml", tmp_path)
    try:
        said = "[bystander]: /crasher: quarantined: 11 exits within 300 s"
        wait_until(lambda: said in (tmp_path / "out").read_text(), timeout_s=LONG_S)
        assert "exit code 1: RuntimeError: the motor does not answer" in (tmp_path / "out").read_text()
    finally:
        running.send_signal(signal.SIGINT)
        assert running.wait(LONG_S) == 0
