"""What every long-running command needs: a stop flag that Ctrl-C and SIGTERM set, and the status file."""

from __future__ import annotations

import json
import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

from metaros.concurrency.signals import StopEvent, stop_signals

__all__ = ["status_file", "stop_on_signals", "wait_for_stop", "write_status"]

_SLICE_S = 0.5


@contextmanager
def stop_on_signals() -> Iterator[threading.Event]:
    """An event that SIGINT, SIGTERM and Ctrl-Break set; a second one ends the process at once: the end may hang."""
    stop = StopEvent()

    def ask(number: int, frame: FrameType | None) -> None:
        if stop.is_set():
            os._exit(130)
        stop.set()

    before = {number: signal.signal(number, ask) for number in stop_signals()}
    try:
        yield stop
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def wait_for_stop(stop: threading.Event) -> None:
    """Wait in slices: on Windows a wait without an end never lets a signal's handler run."""
    while not stop.wait(_SLICE_S):
        pass


def status_file(name: str) -> Path | None:
    """The option's text as a path; empty is none."""
    return Path(name) if name else None


def write_status(path: Path | None, **facts: object) -> None:
    """Say "ready" to whoever started us: the file appears whole or not at all."""
    if path is None:
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    draft = path.with_name(f"{path.name}.{os.getpid()}.tmp")
    draft.write_text(json.dumps({"pid": os.getpid(), "ready": True, **facts}))
    draft.replace(path)
