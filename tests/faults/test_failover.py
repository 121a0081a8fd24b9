"""A migratable node's host is lost: it runs elsewhere soon, and never twice at once. Real programs, real networks."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.faults.campaigns import skip_without_namespaces
from tests.support.processes.netns import INSIDE
from tests.support.processes.processes import started
from tests.support.robots.failover_testbed import Life, lives_in, overlaps

ROOT = Path(__file__).resolve().parents[2]
OWN = ("--pid", "--mount-proc")  # its processes, also the supervisors, which outlive their agents, end with it
LIMIT_S = 10.0  # the promise


def libfaketime() -> str:
    """Where it is, so that the gateway's calendar can be set meanwhile; the rest is tried without it."""
    return next((str(path) for path in sorted(Path("/usr/lib").glob("*/faketime/libfaketimeMT.so.1"))), "")


@pytest.mark.integration
@pytest.mark.timeout(600)
def test_it_runs_remote_soon_and_never_twice(tmp_path: Path) -> None:
    skip_without_namespaces()
    command = [
        *INSIDE,
        *OWN,
        sys.executable,
        "-m",
        "tests.support.robots.failover_testbed",
        str(tmp_path),
        libfaketime(),
    ]
    with started(command, stderr=subprocess.STDOUT, cwd=ROOT) as process:
        output, _ = process.communicate(timeout=580)
    print(output)
    assert process.returncode == 0, output
    found = json.loads(output.splitlines()[-1])
    assert found["problems"] == []
    took = found["took"]
    assert len(took) == 4
    took.pop("host and gateway killed, from when the gateway is back")  # its robots come back when they can
    assert max(took.values()) <= LIMIT_S


def test_the_checker_sees_two_at_once() -> None:
    lines = "far 1 1 100\nfar 1 1 300\nnear 2 2 400\nnear 2 2 500\n"
    assert lives_in(lines) == [Life("far", 1, 100, 300), Life("near", 2, 400, 500)]
    assert overlaps(lives_in(lines)) == []
    assert len(overlaps(lives_in(lines + "far 1 1 401\n"))) == 1
    assert len(overlaps(lives_in(lines.replace("near 2 2", "near 2 1")))) == 1
