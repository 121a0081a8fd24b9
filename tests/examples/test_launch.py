"""The launch tables of the examples, as a user would launch them."""

from __future__ import annotations

import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tests.support.ports import free_port
from tests.support.processes.processes import END_S, started
from tests.support.waiting import wait_until

ROOT = Path(__file__).resolve().parents[2]


@contextmanager
def launched(table: str, folder: Path) -> Iterator[Path]:
    """`metaros launch` with this table, ended by Ctrl-C; gives the file with its output."""
    options = ["--zenoh-port", str(free_port()), "--log-dir", str(folder / "logs")]
    command = [sys.executable, "-m", "metaros", "launch", f"examples/{table}", *options]
    path = folder / "out"
    with path.open("wb") as out, started(command, stdout=out, stderr=out, cwd=ROOT) as running:
        yield path
        running.send_signal(signal.SIGINT)
        assert running.wait(END_S) == 0, path.read_text()


def test_a_robot_whose_consumer_hears_its_driver(tmp_path: Path) -> None:
    with launched("robot.toml", tmp_path) as out:
        wait_until(lambda: "m to the obstacle" in out.read_text())
        text = out.read_text()
        assert "[robot.driver]: the front sensor measures 5 times a second" in text
        assert text.index("driver   ▶ started") < text.index("consumer ▶ started")
