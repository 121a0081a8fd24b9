"""The examples of services and actions, run as a user would run them."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tests.support.processes.processes import END_S, started

ROOT = Path(__file__).resolve().parents[2]


def environment(router: str) -> dict[str, str]:
    return {**os.environ, "METAROS_ZENOH_PORT": router.rsplit(":", 1)[1], "PYTHONUNBUFFERED": "1"}


@contextmanager
def server(script: str, router: str) -> Iterator[None]:
    """The server example, ended by Ctrl-C, which must not take long."""
    command = [sys.executable, f"examples/{script}"]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    with started(command, cwd=ROOT, env=environment(router), **quiet) as process:
        yield
        process.send_signal(signal.SIGINT)
        assert process.wait(END_S) in (0, 130)


def client(script: str, router: str, *arguments: str) -> str:
    """The client example's output."""
    command = [sys.executable, f"examples/{script}", *arguments]
    done = subprocess.run(command, cwd=ROOT, env=environment(router), capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_add_two_ints(zenoh_router: str) -> None:
    with server("add_two_ints_server.py", zenoh_router):
        said = client("add_two_ints_client.py", zenoh_router, "40", "2")
    assert "40 + 2 = 42" in said
    assert "[194, 196, 198]" in said


def test_fibonacci(zenoh_router: str) -> None:
    with server("fibonacci_server.py", zenoh_router):
        said = client("fibonacci_client.py", zenoh_router)
        assert "so far: [0, 1, 1, 2, 3]" in said
        assert "SUCCEEDED: [0, 1, 1, 2, 3, 5]" in said
        said = client("fibonacci_client.py", zenoh_router, "--order", "40", "--cancel-after", "1")
        assert "cancel: granted" in said
        assert "CANCELED: [0, 1, 1" in said
