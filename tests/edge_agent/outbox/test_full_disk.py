"""A disk that is really full, again and again: no event is lost, and the outbox goes on as soon as there is space."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

CYCLES = 6
ROOT = Path(__file__).resolve().parents[3]


def can_mount() -> bool:
    """Whether this machine lets us have a tiny disk of our own."""
    if sys.platform != "linux" or shutil.which("unshare") is None:
        return False
    probe = ["unshare", "-Urnm", "sh", "-c", "mount -t tmpfs -o size=64k none /mnt"]
    return subprocess.run(probe, capture_output=True).returncode == 0


@pytest.mark.skipif(not can_mount() and not os.environ.get("CI"), reason="needs unshare and tmpfs")
def test_events_survive_a_full_disk_and_acceptance_resumes(tmp_path: Path) -> None:
    script = 'mount -t tmpfs -o size=1m none "$1" && exec "$2" -m tests.support.robots.full_disk "$1" "$3"'
    command = ["unshare", "-Urnm", "sh", "-c", script, "sh", str(tmp_path), sys.executable, str(CYCLES)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, cwd=ROOT)
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert result["cycles"] == result["resumed"] == CYCLES, result
    assert result["events"] == result["events_stored"] > 10 * CYCLES, result
    assert result["declared_lost"] > 0, "the disk was never full"
