"""Starts the robot's supervisor where none runs: detached, in a session of its own, so that it outlives the agent."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from metaros.errors import UnavailableError
from metaros.supervise import parent_death
from metaros.supervise.heartbeats import ENVIRONMENT as HEARTBEAT
from metaros.supervise.program import STOPPED, running_pid
from metaros.supervise.service import TABLE

__all__ = ["BASE_PYTHON", "Launcher", "python_of_base"]

BASE_PYTHON: Final = "METAROS_BASE_PYTHON"  # the install that an update never replaces
_OURS: Final = (parent_death.PARENT, HEARTBEAT)  # of the agent alone
_SECRETS: Final = ("METAROS_KEY", "METAROS_STORE", "METAROS_OBJECTS")  # of whoever started it: no business of any node


def python_of_base(environ: Mapping[str, str] = os.environ) -> str:
    """The interpreter that is there after every update of the agent."""
    return environ.get(BASE_PYTHON) or sys.executable


class Launcher:
    """Of one state directory."""

    def __init__(self, directory: Path, *, environ: Mapping[str, str] = os.environ) -> None:
        self._directory = directory
        self._environ = environ
        self._burial: threading.Thread | None = None  # waits for one that we started: else a dead one stays a zombie

    @property
    def running(self) -> bool:
        """Whether a supervisor holds the directory."""
        return running_pid(self._directory) is not None

    @property
    def starting(self) -> bool:
        """Whether one that we have started still lives."""
        return self._burial is not None and self._burial.is_alive()

    @property
    def stopped_by_hand(self) -> bool:
        """Whether somebody asked it to end and has not started it since."""
        return (self._directory / STOPPED).exists()

    @property
    def why_stopped(self) -> str:
        """The same for people, and how it is started again; "" where nobody did."""
        if not self.stopped_by_hand:
            return ""
        return f"the supervisor was stopped by hand: metaros supervisor --state-dir {self._directory}"

    @property
    def has_table(self) -> bool:
        """Whether there is a table that it would run."""
        return (self._directory / TABLE).exists()

    def start(self) -> bool:
        """Start one, unless it runs: whether we did. When two are started, one of them ends at once.

        Raises:
            UnavailableError: somebody stopped it on purpose, or the system cannot start it.
        """
        if self.running:
            return False
        if why := self.why_stopped:
            raise UnavailableError(why)
        argv = [python_of_base(self._environ), "-m", "metaros", "supervisor", "--detached"]
        try:
            child = subprocess.Popen(
                [*argv, "--state-dir", str(self._directory)],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                cwd=self._directory,
                env={name: value for name, value in self._environ.items() if name not in (*_OURS, *_SECRETS)},
                **_apart(),
            )
        except OSError as error:
            raise UnavailableError(f"the supervisor cannot be started: {error.strerror}") from None
        self._burial = threading.Thread(target=child.wait, name="metaros-supervisor", daemon=True)
        self._burial.start()
        return True


def _apart() -> dict[str, Any]:
    """Neither our terminal's signals nor our end reach it."""
    if sys.platform == "win32":
        flags = subprocess.DETACHED_PROCESS | subprocess.CREATE_NEW_PROCESS_GROUP | subprocess.CREATE_BREAKAWAY_FROM_JOB
        return {"creationflags": flags}
    else:
        return {"start_new_session": True}
