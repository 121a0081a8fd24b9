"""The reference page and the example say what the code does."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import threading
from pathlib import Path

import metaros
from metaros.sim import run_sim
from metaros.sim.camera import CAMERA
from metaros.sim.faults import CLEAR, FAULTS
from metaros.sim.node import TOPICS
from metaros.sim.robot import DRIVE
from tests.support.waiting import wait_until

ROOT = Path(__file__).resolve().parents[3]
PAGE = (ROOT / "docs/reference/simulator.md").read_text()


def test_every_topic_and_rate_is_in_the_table() -> None:
    for topic in TOPICS:
        row = next(line for line in PAGE.splitlines() if line.startswith(f"| `{topic.topic}` |"))
        assert topic.type.__metaros_name__ in row
        assert f"| {topic.rate_hz:g} Hz |" in row


def test_every_fault_is_in_the_table() -> None:
    assert [name for name in (*FAULTS, CLEAR) if f"| `{name}` |" not in PAGE] == []


def test_the_figures_are_those_of_the_code() -> None:
    for text in (
        f"{CAMERA.columns} × {CAMERA.rows} JPEG",
        f"±{DRIVE.max_linear_m_s} m/s",
        f"±{DRIVE.max_angular_rad_s} rad/s",
    ):
        assert text in PAGE


def test_the_snippet_runs() -> None:
    (block,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    done = subprocess.run([sys.executable, "-c", block], cwd=ROOT, capture_output=True, text=True, check=True)
    assert re.fullmatch(r"[\d.]+ [\d.]+ battery \d+%\n", done.stdout)


def test_drive_square_drives_a_square(zenoh_router: str, tmp_path: Path) -> None:
    stop, status = threading.Event(), tmp_path / "status.json"
    with metaros.Context(connect=zenoh_router) as context:
        options = {"context": context, "robots": 1, "seed": 1, "camera": False, "stop": stop, "status_file": status}
        sim = threading.Thread(target=run_sim, kwargs=options)
        sim.start()
        try:
            wait_until(status.exists)
            port = zenoh_router.rsplit(":", 1)[1]
            environ = {**os.environ, "METAROS_ZENOH_PORT": port, "PYTHONPATH": str(ROOT)}
            done = subprocess.run(
                [sys.executable, "examples/drive_square.py", "sim_1"],
                cwd=ROOT,
                env=environ,
                capture_output=True,
                text=True,
                timeout=120,
            )
        finally:
            stop.set()
            sim.join(60)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("side ended") == done.stdout.count("turn ended") == 4
    assert "resumed autonomy on request" in done.stdout
