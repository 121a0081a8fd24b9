"""Run a campaign as its users do, and show what it says."""

from __future__ import annotations

import contextlib
import io
import os
from pathlib import Path

import pytest

from load_tests.campaigns.__main__ import main
from tests.support.processes.netns import why_not

__all__ = ["run_campaign", "skip_without_faketime", "skip_without_namespaces"]


def run_campaign(name: str, *options: str) -> str:
    """Its output; fails with it when a promise was broken. The seed is in the output, to repeat it.

    In this process: robots and gateways come from the worker's fork server, which has imported everything once.
    """
    reported = io.StringIO()
    try:
        with contextlib.redirect_stdout(reported):
            code = main([name, *options])
    finally:
        print(reported.getvalue())
    assert code == 0, reported.getvalue()
    return reported.getvalue()


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
