"""Nodes outlive a killed agent, a cut link and a killed gateway, and die with their supervisor alone.

Over updates of their agent they are in `test_update_rollout.py`.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.faults.campaigns import skip_without_namespaces
from tests.support.robots.node_survival import INSIDE

ROOT = Path(__file__).resolve().parents[3]


@pytest.mark.integration
@pytest.mark.timeout(1200)
def test_nodes_keep_their_processes_over_all_but_the_supervisors_end(tmp_path: Path) -> None:
    skip_without_namespaces()

    story = [*INSIDE, sys.executable, "-m", "tests.support.robots.node_survival", str(tmp_path)]
    done = subprocess.run(story, cwd=ROOT, capture_output=True, text=True, timeout=1100, check=False)

    print(done.stdout)
    assert done.returncode == 0, done.stdout + done.stderr
