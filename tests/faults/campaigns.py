"""Run a campaign as its users do, and show what it says."""

from __future__ import annotations

import contextlib
import io
import os
from pathlib import Path

import pytest

from load_tests.campaign import main
from tests.support.netns import why_not

__all__ = ["run_campaign", "skip_without_faketime", "skip_without_namespaces"]


def run_campaign(name: str, *options: str) -> str:
    """Its output; fails with it when a promise was broken. The seed is in the output, to repeat it.

    In this process: robots and gateways come from the worker's fork server, which has imported everything once.
    """
    told = io.StringIO()
    try:
        with contextlib.redirect_stdout(told):
            code = main([name, *options])
    finally:
        print(told.getvalue())
    assert code == 0, told.getvalue()
    return told.getvalue()


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
