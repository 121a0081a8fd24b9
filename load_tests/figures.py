"""The figures of a benchmark's run, kept as JSON in `.make/bench/`: what the summary and the page of figures show.

A benchmark notes what it has just measured under a name that stands in `load_tests/goals.py`, a value a round. Whoever
runs it gathers what it noted; a benchmark that is run by itself, as a module, keeps nothing.
"""

from __future__ import annotations

import json
import os
import platform
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, field
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

__all__ = ["FOLDER", "Noted", "Run", "gathered", "note", "read_runs"]

FOLDER = Path(__file__).resolve().parents[1] / ".make" / "bench"


@dataclass(frozen=True, slots=True)
class Noted:
    """One figure, a value a round, and the peer's of the same rounds."""

    values: list[float]
    peer: list[float]


@dataclass(slots=True, kw_only=True)
class Run:
    """One run of a benchmark. `load`: of the last minute when it began, what else the machine did; None: not known."""

    benchmark: str
    options: list[str]
    at: str
    machine: str
    load: float | None
    seconds: float = 0.0
    code: int = 0
    figures: dict[str, Noted] = field(default_factory=dict)
    peers: dict[str, str] = field(default_factory=dict)  # versions of those that are installed


PEERS = ("eclipse-zenoh", "foxglove-sdk", "mcap", "moto", "pyzmq", "rosbags", "velodyne-decoder")
_runs: list[Run] = []


def note(figure: str, values: Sequence[float], *, peer: Sequence[float] = ()) -> None:
    """Remember a figure of the benchmark that runs; nothing where nobody gathers."""
    if _runs:
        _runs[-1].figures[figure] = Noted([float(one) for one in values], [float(one) for one in peer])


@contextmanager
def gathered(benchmark: str, options: Sequence[str], *, folder: Path = FOLDER) -> Iterator[Run]:
    """Gather what the benchmark notes inside, and keep it when it came to its end; its exit code is to be set."""
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else None
    at = time.strftime("%Y-%m-%d %H:%M", time.gmtime())
    run = Run(benchmark=benchmark, options=list(options), at=at, machine=machine(), load=load, peers=_versions())
    _runs.append(run)
    began_s = time.monotonic()
    try:
        yield run
    finally:
        _runs.pop()
    run.seconds = time.monotonic() - began_s
    if run.figures:
        folder.mkdir(parents=True, exist_ok=True)
        draft = folder / f"{benchmark}.json.new"
        draft.write_text(json.dumps(asdict(run), indent=1) + "\n")
        draft.replace(folder / f"{benchmark}.json")


def read_runs(folder: Path = FOLDER) -> dict[str, Run]:
    """The last run of every benchmark that has one."""
    found = {}
    for path in sorted(folder.glob("*.json")):
        kept: dict[str, Any] = json.loads(path.read_text())
        kept["figures"] = {name: Noted(**one) for name, one in kept["figures"].items()}
        found[path.stem] = Run(**kept)
    return found


def machine() -> str:
    """This machine, in a line."""
    name = next(
        (line.partition(":")[2].strip() for line in _cpu_lines() if line.startswith("model name")),
        platform.processor() or platform.machine(),
    )
    return f"{os.cpu_count()} × {name}, {platform.system()} {platform.release()}, Python {platform.python_version()}"


def _versions() -> dict[str, str]:
    found = {}
    for name in PEERS:
        with suppress(PackageNotFoundError):
            found[name] = version(name)
    return found


def _cpu_lines() -> list[str]:
    try:
        return Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return []
