"""Events of processes."""

from __future__ import annotations

import signal
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

__all__ = [
    "ProcessExited",
    "ProcessIO",
    "ProcessStarted",
    "ProcessStderr",
    "ProcessStdout",
    "RunningProcessEvent",
    "ShutdownProcess",
    "SignalProcess",
    "matches_action",
    "matches_executable",
    "matches_name",
    "matches_pid",
]


@dataclass(kw_only=True)
class RunningProcessEvent:
    """Of one process: the action that started it, its name in the launch, command, number."""

    action: Any
    process_name: str
    cmd: list[str]
    cwd: str | None
    env: dict[str, str] | None
    pid: int


@dataclass(kw_only=True)
class ProcessStarted(RunningProcessEvent):
    """It runs."""


@dataclass(kw_only=True)
class ProcessExited(RunningProcessEvent):
    """It ended; a negative code is the number of a signal."""

    returncode: int


@dataclass(kw_only=True)
class ProcessIO(RunningProcessEvent):
    """It wrote a line. Both of its outputs come as one."""

    text: bytes
    from_stdin = False
    from_stdout = True
    from_stderr = False


ProcessStdout = ProcessStderr = ProcessIO


@dataclass(kw_only=True)
class ShutdownProcess:
    """Ask the processes that match to end."""

    process_matcher: Callable[[Any], bool]


class SignalProcess:
    """Send a signal to the processes that match."""

    def __init__(self, *, signal_number: str | signal.Signals | int, process_matcher: Callable[[Any], bool]) -> None:
        number = getattr(signal, signal_number) if isinstance(signal_number, str) else signal_number
        self.signal = signal.Signals(number)
        self.process_matcher = process_matcher

    @property
    def signal_name(self) -> str:
        """Such as SIGUSR1."""
        return self.signal.name


def matches_action(action: Any) -> Callable[[Any], bool]:
    """The processes of this action."""
    return lambda found: found is action


def matches_pid(pid: int) -> Callable[[Any], bool]:
    """The process of this number."""
    return lambda found: bool(found.process_details and found.process_details["pid"] == pid)


def matches_name(name: str) -> Callable[[Any], bool]:
    """The processes of this name in the launch."""
    return lambda found: bool(found.process_details and found.process_details["name"] == name)


def matches_executable(name: str) -> Callable[[Any], bool]:
    """The processes whose command is this executable."""
    return lambda found: bool(found.process_details and found.process_details["cmd"][0].rpartition("/")[2] == name)
