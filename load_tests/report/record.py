"""The JSON of a report: what ran, where, when, and every round's figures; and two of them compared."""

from __future__ import annotations

import importlib.metadata
import json
import os
import platform
import subprocess
import sys
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import psutil

from metaros.clock import SystemClock

__all__ = ["Change", "Record", "changes", "load", "machine", "save"]

PACKAGES = ("metaros", "grpcio", "protobuf", "uvicorn", "uvloop", "websockets", "numpy", "zstandard")
# Figures that a comparison shows: path, unit, whether less is better.
COMPARED = (
    ("gateway_cores", "cores", True),
    ("gateway_us_per_frame", "us", True),
    ("gateway_rss_mib", "MiB", True),
    ("rss_per_robot_kib", "KiB", True),
    ("pss_per_robot_kib", "KiB", True),
    ("ack_ms.p50", "ms", True),
    ("ack_ms.p99", "ms", True),
    ("heartbeat_ms.p99", "ms", True),
    ("http_ms.p99", "ms", True),
    ("latency_ms.p50", "ms", True),
    ("latency_ms.p99", "ms", True),
    ("all_back_s", "s", True),
    ("pinned_s", "s", True),
    ("link_up_ms.p99", "ms", True),
    ("gateway_us_per_robot_s", "us/s", True),
)


@dataclass(slots=True)
class Record:
    """One report. `rounds` are dictionaries of figures; `series` and `marks` in them are for the plots."""

    scenario: str
    title: str
    command: str
    machine: dict[str, Any]
    rounds: list[dict[str, Any]] = field(default_factory=list)
    interrupted: bool = False
    notes: list[str] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class Change:
    """One figure of two reports."""

    round: str
    figure: str
    unit: str
    before: float
    after: float
    less_is_better: bool

    @property
    def ratio(self) -> float:
        """After over before; 1 where there was nothing."""
        return self.after / self.before if self.before else 1.0

    @property
    def arrow(self) -> str:
        """Better, worse, or a tie: within 10 %."""
        if 0.9 <= self.ratio <= 1.1:
            return "="
        return "better" if (self.ratio < 1) == self.less_is_better else "worse"


def machine() -> dict[str, Any]:
    """Where and with what it ran."""
    lines = Path("/proc/cpuinfo").read_text().splitlines() if Path("/proc/cpuinfo").exists() else []
    model = next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), "")
    return {
        "at": SystemClock().wall_ns() // 1_000_000_000,
        "cpu": model or platform.processor(),
        "cores": os.cpu_count() or 0,
        "memory_gib": round(psutil.virtual_memory().total / 2**30, 1),
        "system": platform.platform(),
        "python": sys.version.split()[0],
        "load_average_before": list(os.getloadavg()) if hasattr(os, "getloadavg") else [],
        "versions": {name: importlib.metadata.version(name) for name in PACKAGES},
        "commit": _commit(),
    }


def _commit() -> str:
    try:
        found = subprocess.run(["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, timeout=5)
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return found.stdout.strip()


def save(record: Record, path: Path) -> None:
    """Write the JSON, whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_suffix(".partial")
    partial.write_text(json.dumps(asdict(record), indent=1, default=float))
    partial.replace(path)


def load(path: Path) -> Record:
    """Read one. Raises OSError, ValueError or TypeError for what is no report."""
    return Record(**json.loads(path.read_text()))


def changes(before: Record, after: Record) -> list[Change]:
    """What both have, round by round of the same name."""
    old = {name_of(figures, index): figures for index, figures in enumerate(before.rounds)}
    found = []
    for index, figures in enumerate(after.rounds):
        earlier = old.get(name_of(figures, index))
        for path, unit, less in COMPARED if earlier is not None else ():
            was, now = value_of(earlier, path), value_of(figures, path)
            if was is not None and now is not None:
                found.append(Change(name_of(figures, index), path, unit, was, now, less))
    return found


def name_of(figures: dict[str, Any], index: int) -> str:
    """What a round is called: its own name, or its place."""
    return str(figures.get("name") or f"round {index + 1}")


def value_of(figures: dict[str, Any] | None, path: str) -> float | None:
    """A figure by its dotted path."""
    found: Any = figures
    for word in path.split("."):
        found = found.get(word) if isinstance(found, dict) else None
    return float(found) if isinstance(found, int | float) else None
