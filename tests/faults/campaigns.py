"""Run a campaign as its users do, in a process of its own, and show what it says."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.netns import why_not

__all__ = ["run_campaign", "skip_without_faketime", "skip_without_namespaces"]

ROOT = Path(__file__).resolve().parents[2]


def run_campaign(name: str, *options: str, timeout_s: float) -> str:
    """Its output; fails with it when a promise was broken. The seed is in the output, to repeat it."""
    command = [sys.executable, "-m", "load_tests.campaign", name, *options]
    with subprocess.Popen(
        command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True
    ) as process:
        try:
            output, _ = process.communicate(timeout=timeout_s)
        finally:
            if process.poll() is None:  # its children go with it: they die with their parent
                process.kill()
    print(output)
    assert process.returncode == 0, output
    return output


def skip_without_namespaces() -> None:
    """Say why where namespaces are refused; in CI they never are."""
    if reason := why_not():
        assert not os.environ.get("CI"), f"CI must be able to: {reason}"
        pytest.skip(reason)


def skip_without_faketime() -> str:
    """Where libfaketime is, for LD_PRELOAD; says so where it is not installed."""
    for path in sorted(Path("/usr/lib").glob("*/faketime/libfaketime.so.1")):
        return str(path)
    assert not os.environ.get("CI"), "CI must have libfaketime"
    pytest.skip("libfaketime is not installed (Debian: apt install libfaketime)")
