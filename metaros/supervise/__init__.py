"""Keep a table of processes running: a pure restart policy, and the processes, logs and clean stop around it."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from metaros.supervise.child import ProcessStatus
    from metaros.supervise.events import Event, EventKind
    from metaros.supervise.logs import RotatingLog
    from metaros.supervise.policy import Exit, History, Quarantine, RestartAt, RestartPolicy, Stop, decide
    from metaros.supervise.process import Launch, Process
    from metaros.supervise.supervisor import Supervisor
    from metaros.supervise.table import LaunchTable, NodeRow, read_table

__all__ = [
    "Event",
    "EventKind",
    "Exit",
    "History",
    "Launch",
    "LaunchTable",
    "NodeRow",
    "Process",
    "ProcessStatus",
    "Quarantine",
    "RestartAt",
    "RestartPolicy",
    "RotatingLog",
    "Stop",
    "Supervisor",
    "decide",
    "read_table",
]

_HOMES = {  # loaded when used: a supervised node needs the guard alone, and must start fast
    "child": ("ProcessStatus",),
    "events": ("Event", "EventKind"),
    "logs": ("RotatingLog",),
    "policy": ("Exit", "History", "Quarantine", "RestartAt", "RestartPolicy", "Stop", "decide"),
    "process": ("Launch", "Process"),
    "supervisor": ("Supervisor",),
    "table": ("LaunchTable", "NodeRow", "read_table"),
}
_HOME = {name: home for home, names in _HOMES.items() for name in names}


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"metaros.supervise.{_HOME[name]}"), name)
