"""The figures of a benchmark's run, as JSON in `.make/bench/`; those of the last published one are in the repository.

A benchmark notes what it has just measured under a name that stands in `load_tests/goals.py`, a value a round. Whoever
runs it gathers what it noted; a benchmark that is run by itself, as a module, keeps nothing.
"""

from __future__ import annotations

import json
import os
import platform
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, field
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from load_tests.goals import variant_of

__all__ = ["FOLDER", "KEPT", "Noted", "Run", "gathered", "keep", "note", "read_kept", "read_runs"]

FOLDER = Path(__file__).resolve().parents[1] / ".make" / "bench"
KEPT = Path(__file__).resolve().parent / "kept_runs.json"
_DIGITS = 6  # of a value: more than any benchmark can tell apart


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

    @property
    def name(self) -> str:
        """The benchmark, and those of its options without which the figures are others."""
        return f"{self.benchmark} {variant_of(self.benchmark, self.options)}".rstrip()


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
        file = folder / f"{run.name.replace(' ', '')}.json"
        draft = file.with_suffix(".new")
        draft.write_text(json.dumps(asdict(run), indent=1) + "\n")
        draft.replace(file)


def read_runs(folder: Path = FOLDER) -> dict[str, Run]:
    """The last run of every benchmark that has one, by its name."""
    return _by_name(json.loads(path.read_text()) for path in sorted(folder.glob("*.json")))


def read_kept(file: Path = KEPT) -> dict[str, Run]:
    """The runs whose figures are published, by their names."""
    return _by_name(json.loads(file.read_text())) if file.exists() else {}


def keep(runs: Mapping[str, Run], file: Path = KEPT) -> dict[str, Run]:
    """Let these be what is published, each in the place of the one before; all that are kept then."""
    kept = dict(sorted({**read_kept(file), **runs}.items()))
    file.write_text(json.dumps([_rounded(asdict(run)) for run in kept.values()], indent=1) + "\n")
    return kept


def _by_name(stored: Iterable[dict[str, Any]]) -> dict[str, Run]:
    found = {}
    for one in stored:
        one["figures"] = {name: Noted(**values) for name, values in one["figures"].items()}
        run = Run(**one)
        found[run.name] = run
    return found


def _rounded(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _rounded(one) for name, one in value.items()}
    if isinstance(value, list):
        return [_rounded(one) for one in value]
    return float(f"{value:.{_DIGITS}g}") if isinstance(value, float) else value


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
