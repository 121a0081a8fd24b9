"""Keep a table of processes running: a pure restart policy, and the processes, logs and clean stop around it."""

from __future__ import annotations

from metaros.supervise.events import Event, EventKind
from metaros.supervise.logs import RotatingLog
from metaros.supervise.policy import (
    Exit,
    History,
    Quarantine,
    RestartAt,
    RestartPolicy,
    Stop,
    decide,
)
from metaros.supervise.process import Launch, Process
from metaros.supervise.supervisor import ProcessStatus, Supervisor

__all__ = [
    "Event",
    "EventKind",
    "Exit",
    "History",
    "Launch",
    "Process",
    "ProcessStatus",
    "Quarantine",
    "RestartAt",
    "RestartPolicy",
    "RotatingLog",
    "Stop",
    "Supervisor",
    "decide",
]
