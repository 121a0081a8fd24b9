"""Keep a table of processes running: a pure restart policy, and the processes, logs and clean stop around it."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from metaros.supervise.child import ProcessStatus
    from metaros.supervise.events import Event, EventKind
    from metaros.supervise.launch_table import LaunchTable, NodeRow, read_table
    from metaros.supervise.logs.file import RotatingLog
    from metaros.supervise.process import Launch, Process
    from metaros.supervise.restart_policy import Exit, History, Quarantine, RestartAt, RestartPolicy, Stop, decide
    from metaros.supervise.supervisor import Supervisor

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

_EXPORTS = {  # loaded when used: a supervised node needs `parent_death` alone, and must start fast
    "child": ("ProcessStatus",),
    "events": ("Event", "EventKind"),
    "logs.file": ("RotatingLog",),
    "restart_policy": ("Exit", "History", "Quarantine", "RestartAt", "RestartPolicy", "Stop", "decide"),
    "process": ("Launch", "Process"),
    "supervisor": ("Supervisor",),
    "launch_table": ("LaunchTable", "NodeRow", "read_table"),
}
_MODULE_OF = {name: module for module, names in _EXPORTS.items() for name in names}


def __getattr__(name: str) -> Any:
    if name not in _MODULE_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"metaros.supervise.{_MODULE_OF[name]}"), name)
