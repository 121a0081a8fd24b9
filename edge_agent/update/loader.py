"""`metaros agent-slot`: starts the agent's version that `slots/current` names, and is itself never replaced in place.

A version that has proved itself takes over this very process, so that whoever started it (systemd, a supervisor, a
terminal) sees one process. Of a version on trial this one stays the parent: it counts the starts before it makes them,
and goes back to what ran before when the version ends too often or is not kept in its time. The child dies with it, and
who is started next finds the count.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from edge_agent.state.state_dir import default_state_dir
from edge_agent.update.environment import BASE_PYTHON, BASE_SITE, base_places
from edge_agent.update.restart import LOADER_ENV, RESTART_EXIT_CODE
from edge_agent.update.slots import BASE, Current, Slots, python_of
from metaros.clock import Clock, SystemClock
from metaros.concurrency.file_lock import take_lock
from metaros.concurrency.signals import StopEvent, stop_signals
from metaros.errors import ConfigError
from metaros.limits import LIMITS
from metaros.supervise import parent_death

__all__ = ["Loader", "state_dir_of"]

GRACE_S, GRACE_SHARE = 5.0, 0.25  # for an agent that takes itself back, beyond its own time
STOP_S = 20.0  # between asking a child to end and ending it
STEP_S = 0.1
PAUSE_S = 1.0  # between two starts of a version on trial


def state_dir_of(name: str | None, state_dir: Path | None, config: Path | None) -> Path:
    """Where the agent of these options keeps its state. Keys of the file that this version does not know do not matter.

    Raises:
        ConfigError: there is no such file, or it is no TOML.
    """
    table = {}
    if config is not None:
        from edge_agent.config.settings import read_toml

        table = read_toml(config)
    if state_dir is None and isinstance(table.get("state_dir"), str):
        state_dir = Path(table["state_dir"])
    if state_dir is not None:
        return state_dir.absolute()
    name = name or (table["name"] if isinstance(table.get("name"), str) else "")
    if not name:
        from edge_agent.config.settings import sanitised_hostname

        name = sanitised_hostname()
    return default_state_dir(name)


@dataclass(frozen=True, slots=True, kw_only=True)
class Loader:
    """One robot's loader. `arguments` are the agent's, as they were given."""

    state_dir: Path
    arguments: tuple[str, ...]
    health_s: float = LIMITS.update_health_s
    link_s: float = LIMITS.update_link_s
    boots: int = LIMITS.update_boots

    def run(self, clock: Clock | None = None) -> int:
        """Start the agent, again where it asks for it; the exit code. A good version takes over the process instead.

        Raises:
            ConfigError: another loader watches an agent of this state directory.
        """
        slots, clock, stop = Slots(self.state_dir), clock or SystemClock(), StopEvent()
        lock = self._lock(slots)
        try:
            while True:
                current = slots.boot(most=self.boots)
                if not current.probing and sys.platform != "win32":
                    if stop.is_set():
                        return 0
                    argv = self.command(slots, current)
                    os.execve(argv[0], argv, self.environment(current, watcher=0))
                code = self._watch(slots, current, clock, stop)
                if code is not None:
                    return code
        finally:
            os.close(lock)

    def command(self, slots: Slots, current: Current) -> list[str]:
        """The agent of a slot."""
        if current.slot == BASE:
            return [sys.executable, "-P", "-m", "metaros", "agent", *self.arguments]
        return [str(python_of(slots.path(current.slot))), "-I", "-m", "metaros", "agent", *self.arguments]

    def environment(self, current: Current, *, watcher: int, environ: Mapping[str, str] = os.environ) -> dict[str, str]:
        """The environment of the agent that is started."""
        loader = [sys.executable, "-P", "-m", "metaros", "agent-slot", *self._options(), "--", *self.arguments]
        table = {"loader": loader, "watcher": watcher, "health_s": self.health_s, "link_s": self.link_s}
        return {
            **environ,
            LOADER_ENV: json.dumps(table),
            BASE_PYTHON: sys.executable,
            BASE_SITE: os.pathsep.join(base_places()),
        }

    def _options(self) -> list[str]:
        options = {"--health-s": self.health_s, "--link-s": self.link_s, "--boots": self.boots}
        return [word for name, value in options.items() for word in (name, f"{value:g}")]

    def _watch(self, slots: Slots, current: Current, clock: Clock, stop: StopEvent) -> int | None:
        """Run one start as a child. Its exit code; None: look again what to start."""
        child = _Child(self.command(slots, current), self.environment(current, watcher=os.getpid()), stop)
        end_s = clock.monotonic_s() + max(self.link_s, self.health_s) * (1 + GRACE_SHARE) + GRACE_S
        while (code := child.ended(STEP_S)) is None:
            now = slots.read()
            if now.probing and now.slot == current.slot and clock.monotonic_s() > end_s:
                child.end()
                slots.roll_back(now, "it hung: it was neither kept nor taken back in its time")
                return None
        if stop.is_set():
            slots.uncount_boot()
            return code
        if code == RESTART_EXIT_CODE or (slots.read().probing and not stop.wait(PAUSE_S)):
            return None
        return code

    def _lock(self, slots: Slots) -> int:
        try:
            slots.folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            descriptor = os.open(slots.folder / "lock", os.O_RDWR | os.O_CREAT, 0o600)
        except OSError:  # a full or read-only disk: an agent must run all the same
            return os.open(os.devnull, os.O_RDONLY)
        if not take_lock(descriptor):
            os.close(descriptor)
            raise ConfigError(f"another metaros agent-slot watches an agent in {self.state_dir}")
        return descriptor


class _Child:
    """An agent on trial. What asks this program to end asks the child; on Linux it dies with this program."""

    def __init__(self, argv: Sequence[str], environ: Mapping[str, str], stop: StopEvent) -> None:
        import signal

        self._stop = stop
        before = (
            [] if sys.platform != "linux" else [sys.executable, "-I", "-S", parent_death.__file__, str(os.getpid())]
        )
        for number in stop_signals(hangup=True):
            signal.signal(number, lambda *_: stop.set())
        self._popen = subprocess.Popen([*before, *argv], env=dict(environ), stdin=subprocess.DEVNULL)

    def ended(self, wait_s: float) -> int | None:
        """Its exit code, as a shell would say it; None while it runs. Passes on that this program is to end."""
        try:
            code = self._popen.wait(wait_s)
        except subprocess.TimeoutExpired:
            if self._stop.is_set():
                self.end()
                return self.ended(STOP_S)
            return None
        return code if code >= 0 else 128 - code

    def end(self) -> None:
        """Ask it to end, and end it where it does not."""
        self._popen.terminate()
        try:
            self._popen.wait(STOP_S)
        except subprocess.TimeoutExpired:
            self._popen.kill()
            self._popen.wait()
