"""The measured figures: one entry a round, kept as JSON, read as medians."""

from __future__ import annotations

import json
import os
import platform
import statistics
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from load_tests.peers.rows import ROWS, Row

__all__ = ["BUSY_CORES", "Cell", "Results", "ResultsFileError", "machine"]

FORMAT = 1
BUSY_CORES = 0.25  # a run beside which others used more is said to be disturbed


class ResultsFileError(ValueError):
    """A file that no run of this benchmark has written."""


@dataclass(slots=True)
class Cell:
    """One row at one size: an entry for each round that gave figures, and what went wrong in the others."""

    flood: list[dict[str, Any]] = field(default_factory=list)
    ping: list[dict[str, Any]] = field(default_factory=list)
    errors: list[str] = field(default_factory=list)

    def add(self, phase: str, figures: dict[str, Any]) -> None:
        """What one pair of processes reported."""
        if "error" in figures:
            self.errors.append(figures["error"])
        else:
            getattr(self, phase).append(figures)

    def values(self, name: str) -> list[float]:
        """One figure of every round that has it."""
        return [entry[name] for entry in (*self.flood, *self.ping) if entry.get(name) is not None]

    def median(self, name: str) -> float | None:
        """Its median over the rounds; None where it was not measured."""
        values = self.values(name)
        return statistics.median(values) if values else None

    @property
    def arrived(self) -> float | None:
        """The share of what was published that reached the callback."""
        rate, sent = self.median("rate"), self.median("sent_rate")
        return min(1.0, rate / sent) if rate is not None and sent else None


@dataclass(slots=True)
class Results:
    """A whole run."""

    rounds: int
    seconds: float
    sizes: list[int]
    machine: dict[str, Any]
    cells: dict[tuple[int, str], Cell] = field(default_factory=dict)
    many: dict[str, Cell] = field(default_factory=dict)  # rows with 20 subscriptions, by key

    def cell(self, size: int, key: str) -> Cell:
        """The cell, made when it is first asked for."""
        return self.cells.setdefault((size, key), Cell())

    def median(self, size: int, key: str, name: str) -> float | None:
        """A median that may not have been measured."""
        cell = self.cells.get((size, key))
        return cell.median(name) if cell else None

    def rows_at(self, size: int) -> list[tuple[Row, Cell]]:
        """The rows that were tried at a size, in the table's order."""
        return [(row, self.cells[size, row.key]) for row in ROWS if (size, row.key) in self.cells]

    @property
    def done(self) -> int:
        """Rounds of which there are figures: fewer than `rounds` in a run that was interrupted."""
        return max((len(cell.flood) for cell in self.cells.values()), default=0)

    def disturbed(self) -> tuple[int, int]:
        """How many runs had others busy beside them, and of how many."""
        entries = [entry for cell in self.cells.values() for entry in (*cell.flood, *cell.ping)]
        return sum((entry.get("others_cores") or 0) > BUSY_CORES for entry in entries), len(entries)

    def save(self, path: Path) -> None:
        """As JSON, whole or not at all."""
        path.parent.mkdir(parents=True, exist_ok=True)
        cells = [{"size": size, "row": key, **_plain(cell)} for (size, key), cell in self.cells.items()]
        value = {
            "format": FORMAT,
            "rounds": self.rounds,
            "seconds": self.seconds,
            "sizes": self.sizes,
            "machine": self.machine,
            "cells": cells,
            "many": {key: _plain(cell) for key, cell in self.many.items()},
        }
        partial = path.with_name(path.name + ".part")
        partial.write_text(json.dumps(value, indent=1) + "\n")
        partial.replace(path)

    @classmethod
    def load(cls, path: Path) -> Results:
        """What `save` wrote; ResultsFileError for anything else."""
        try:
            value = json.loads(path.read_text())
            if value["format"] != FORMAT:
                raise ResultsFileError(f"{path}: format {value['format']}, not {FORMAT}")
            found = cls(value["rounds"], value["seconds"], value["sizes"], value["machine"])
            for entry in value["cells"]:
                found.cells[entry["size"], entry["row"]] = Cell(entry["flood"], entry["ping"], entry["errors"])
            found.many = {key: Cell(**entry) for key, entry in value["many"].items()}
        except (OSError, KeyError, TypeError, json.JSONDecodeError) as error:
            raise ResultsFileError(f"{path}: {type(error).__name__}: {error}") from None
        return found


def _plain(cell: Cell) -> dict[str, Any]:
    return {"flood": cell.flood, "ping": cell.ping, "errors": cell.errors}


def machine() -> dict[str, Any]:
    """What the figures depend on."""
    return {
        "cores": os.cpu_count(),
        "cpu": _cpu_name(),
        "system": platform.platform(),
        "python": platform.python_version(),
        "zenoh": _version("eclipse-zenoh"),
        "metaros": _version("metaros"),
    }


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "unknown"


def _cpu_name() -> str:
    try:
        text = Path("/proc/cpuinfo").read_text()
    except OSError:
        return platform.processor() or platform.machine()
    names = [line.partition(":")[2].strip() for line in text.splitlines() if line.startswith("model name")]
    return names[0] if names else platform.machine()
