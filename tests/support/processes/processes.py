"""Processes of a test: whatever becomes of the test, none outlives it, and none is left to the next one."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import psutil

if TYPE_CHECKING:
    from tests.support.processes.fork_server import Forked

__all__ = ["END_S", "alive", "end", "started"]

END_S = 60.0  # for an end that takes a moment on a desk: a loaded machine is no fault of the program
_TERMINATE_S = 5.0


@contextmanager
def started(argv: Sequence[str], **options: Any) -> Iterator[subprocess.Popen[str]]:
    """A process with pipes for its output; ended, reaped and its pipes closed at the end, also when the body fails."""
    pipes: dict[str, Any] = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    process = subprocess.Popen(list(argv), **{**pipes, **options})
    try:
        yield process
    finally:
        end(process)


def alive(pid: int) -> bool:
    """Whether a process runs; one that has ended does not, also before it is reaped, which may take init seconds."""
    try:
        return bool(psutil.Process(pid).status() != psutil.STATUS_ZOMBIE)
    except psutil.NoSuchProcess:
        return False


def end(process: subprocess.Popen[Any] | Forked) -> None:
    """Ask it to end, kill it where it does not, reap it, close its pipes; does nothing to one that has ended."""
    try:
        if process.poll() is None:
            process.terminate()
            process.wait(_TERMINATE_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait(END_S)
    finally:
        for pipe in (process.stdin, process.stdout, process.stderr):
            if pipe is not None:
                pipe.close()
