"""The fair executor's example runs as a user would run it, and ends by itself."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def test_fair_executor_shares_by_nice_level(zenoh_router: str) -> None:
    done = subprocess.run(
        [sys.executable, "examples/fair_executor.py", "--seconds", "1"],
        cwd=ROOT,
        env={**os.environ, "METAROS_ZENOH_PORT": zenoh_router.rsplit(":", 1)[1]},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    shares = [float(part) for part in re.findall(r"([\d.]+)% of the thread", done.stdout)]
    planner, mapper, logger = shares
    assert 60 < planner < 80
    assert planner > 2 * mapper > 4 * logger
    assert re.search(r"/control +real-time class: (yes|no: )", done.stdout)
    assert re.search(r"control was called \d{2,} times", done.stdout)
