"""What the tests cost: measured by a real run of a small suite, told by folder and by kind."""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from rich.console import Console

from tools.profile_tests import VARIABLE, Cost, read, report

ROOT = Path(__file__).resolve().parents[2]
SUITE = """
import subprocess, sys, socket, time

def test_nothing():
    pass

def test_a_process_that_computes():
    subprocess.run([sys.executable, "-c", "import time\\nwhile time.process_time() < 0.2: pass"], check=True)

def test_a_socket():
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
"""


def test_a_run_is_measured_with_its_processes(tmp_path: Path) -> None:
    (tmp_path / "test_small.py").write_text(SUITE)
    costs = tmp_path / "costs"
    costs.mkdir()
    environ = {**os.environ, VARIABLE: str(costs), "PYTHONPATH": str(ROOT), "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}
    plugins = ["-p", "tools.profile_tests", "-p", "no:cacheprovider"]
    command = [sys.executable, "-m", "pytest", "-q", *plugins, "--rootdir", str(tmp_path), str(tmp_path)]
    done = subprocess.run(command, env=environ, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    found = {cost.test.partition("::")[2]: cost for cost in read(costs)}
    assert {name: cost.kind for name, cost in found.items()} == {
        "test_nothing": "pure",
        "test_a_process_that_computes": "process",
        "test_a_socket": "in-process",
    }
    computing = found["test_a_process_that_computes"]
    assert computing.cpu_s >= 0.2
    assert computing.wall_s >= computing.setup_s


def test_the_report_adds_up_and_names_the_dearest(tmp_path: Path) -> None:
    costs = [Cost(f"tests/a/b/test_x.py::test_{n}", "pure", wall_s=n, setup_s=0.0, cpu_s=n / 2) for n in range(60)]
    costs.append(Cost("tests/e2e/test_y.py::test_page", "browser", wall_s=100.0, setup_s=9.0, cpu_s=120.0))
    (tmp_path / "gw0.jsonl").write_text("".join(json.dumps(vars_of(cost)) + "\n" for cost in costs))
    assert read(tmp_path) == costs
    shown = io.StringIO()
    report(read(tmp_path), Console(file=shown, width=200))
    lines = [" ".join(line.split()) for line in shown.getvalue().splitlines()]
    assert "tests/a/b 60 1,770.0 885.0 885.0" in lines
    assert "tests/e2e 1 100.0 120.0 0.0" in lines
    assert "browser: Chromium 1 100.0 120.0 0.0" in lines
    assert "tests/e2e/test_y.py::test_page 100.0 9.0 120.0" in lines
    assert sum(line.startswith("tests/a/b/test_x.py::") for line in lines) == 49


def vars_of(cost: Cost) -> dict[str, object]:
    """As a worker writes it."""
    return {name: getattr(cost, name) for name in Cost.__slots__}


@pytest.mark.parametrize("name", ["tests/layout/test_x.py::test", "tests/metaros/cdr/test_x.py::test[a/b]"])
def test_a_folder_has_three_parts_at_most(name: str) -> None:
    cost = Cost(name, "pure", 1.0, 0.0, 1.0)
    assert cost.folder == "/".join(name.partition("::")[0].split("/")[:-1][:3])
