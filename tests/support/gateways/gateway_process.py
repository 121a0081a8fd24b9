"""`metaros gateway` as a process, for tests of what only a process has: signals, kills, its own memory."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tests.support.processes.command_line import program
from tests.support.processes.processes import started
from tests.support.waiting import wait_until

__all__ = ["running"]


@contextmanager
def running(folder: Path, *options: str) -> Iterator[tuple[subprocess.Popen[str], dict[str, object]]]:
    """One that is ready, and its status file; its data are in `folder`/data."""
    status = folder / "status.json"
    command = program("gateway", "--data-dir", str(folder / "data"), "--status-file", str(status), *options)
    with started(command, stderr=subprocess.STDOUT) as process:
        wait_until(lambda: status.exists() or process.poll() is not None)
        assert process.poll() is None, process.communicate()[0]
        yield process, json.loads(status.read_text())
