"""The reference page and the example say what the code does."""

from __future__ import annotations

import re
import runpy
import sys
import threading
from pathlib import Path

import pytest

import metaros
from metaros.node.context import shared_context
from metaros.sim import run_sim
from metaros.sim.camera import CAMERA
from metaros.sim.faults import CLEAR, FAULTS
from metaros.sim.node import TOPICS
from metaros.sim.robot import DRIVE
from tests.support.processes.fast_loop import HurriedClock
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


def test_the_snippet_runs(capsys: pytest.CaptureFixture[str]) -> None:
    (block,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    exec(block, {})
    assert re.fullmatch(r"[\d.]+ [\d.]+ battery \d+%\n", capsys.readouterr().out)


def test_drive_square_drives_a_square(
    zenoh_router: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("METAROS_ZENOH_PORT", zenoh_router.rsplit(":", 1)[1])
    monkeypatch.setattr(sys, "argv", ["drive_square.py", "sim_1"])
    stop, status, clock = threading.Event(), tmp_path / "status.json", HurriedClock(speed=5.0)
    with metaros.Context(connect=zenoh_router, clock=clock) as context:
        options = {"context": context, "robots": 1, "camera": False, "stop": stop, "status_file": status}
        sim = threading.Thread(target=run_sim, kwargs={**options, "resume_after_s": 3600.0})
        sim.start()
        try:
            wait_until(status.exists)
            with shared_context() as own:
                own.clock = clock
                runpy.run_path(str(ROOT / "examples/drive_square.py"), run_name="__main__")
        finally:
            stop.set()
            sim.join(60)
    said = capsys.readouterr().out
    assert said.count("side ended") == said.count("turn ended") == 4
    assert "resumed autonomy on request" in said
