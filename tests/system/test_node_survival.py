"""Nodes outlive a cut link, a killed gateway, a killed agent and its update, and die with their supervisor alone."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.faults.campaigns import skip_without_namespaces
from tests.support.survival_story import INSIDE

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.integration
@pytest.mark.timeout(1200)
@pytest.mark.parametrize("cut_s", [60.0])
def test_nodes_keep_their_processes_over_all_but_the_supervisors_end(tmp_path: Path, cut_s: float) -> None:
    skip_without_namespaces()

    story = [*INSIDE, sys.executable, "-m", "tests.support.survival_story", str(tmp_path), f"{cut_s:g}"]
    done = subprocess.run(story, cwd=ROOT, capture_output=True, text=True, timeout=1100, check=False)

    print(done.stdout)
    assert done.returncode == 0, done.stdout + done.stderr
