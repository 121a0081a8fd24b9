"""What the tests cost, by folder and by kind, and the fifty dearest: `make profile`, `ARGS="tests/gateway -n 4"`.

Runs pytest with itself as a plugin. Each worker writes a line of JSON a test into `.make/profile/`: wall time with
set-up and teardown, CPU time of the worker and of all processes below it, and what kind of test it turned out to be.
Wall time less CPU time is waiting; on a busy machine that is also waiting for a core.

`python tools/profile_tests.py --read [FOLDER]` prints the last run again.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import time
from collections import defaultdict
from collections.abc import Callable, Generator, Iterable
from dataclasses import asdict, dataclass
from pathlib import Path

import pytest
from rich.console import Console
from rich.table import Table

__all__ = ["KINDS", "Cost", "main", "read", "report"]

ROOT = Path(__file__).resolve().parent.parent
FOLDER = ROOT / ".make" / "profile"
VARIABLE = "METAROS_PROFILE"
DEAREST = 50
TICKS_A_SECOND = os.sysconf("SC_CLK_TCK") if hasattr(os, "sysconf") else 100

KINDS = {
    "browser": "Chromium",
    "postgres": "a real PostgreSQL",
    "s3": "a real S3 server",
    "docs": "what the docs say, run",
    "process": "starts processes",
    "in-process": "sockets, threads or a Zenoh session in the worker",
    "pure": "none of these",
}
BY_FIXTURE = {
    "browser": {"browser", "open_page"},
    "postgres": {"postgres", "postgres_server"},
    "s3": {"seaweed", "s3_url"},
}
STARTS = frozenset({"subprocess.Popen", "os.fork", "os.posix_spawn", "os.forkpty"})
OPENS = frozenset({"socket.bind", "socket.connect", "_thread.start_new_thread"})


@dataclass(frozen=True, slots=True)
class Cost:
    """One test: `wall_s` is all of set-up, call and teardown, `setup_s` the part before the call."""

    test: str
    kind: str
    wall_s: float
    setup_s: float
    cpu_s: float

    @property
    def waiting_s(self) -> float:
        """Time in which nothing of this test was computed."""
        return max(0.0, self.wall_s - self.cpu_s)

    @property
    def folder(self) -> str:
        """Where the test is, three folders deep at most."""
        parts = self.test.partition("::")[0].split("/")[:-1]
        return "/".join(parts[:3])


def _cpu_of_children_s() -> float:
    """CPU time of the processes below this one that still run, with what they waited for; 0 where there is no /proc."""
    parents: dict[int, int] = {}
    spent_s: dict[int, float] = {}
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            fields = (entry / "stat").read_text().rpartition(")")[2].split()
        except OSError:
            continue
        pid = int(entry.name)
        parents[pid] = int(fields[1])
        spent_s[pid] = sum(map(int, fields[11:15])) / TICKS_A_SECOND
    below = {os.getpid()}
    size = 0
    while size != len(below):
        size = len(below)
        below |= {pid for pid, parent in parents.items() if parent in below}
    return sum(spent_s.get(pid, 0.0) for pid in below - {os.getpid()})


def _cpu_s() -> float:
    """All CPU time that this worker has caused so far."""
    ended = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + ended.ru_utime + ended.ru_stime + _cpu_of_children_s()


def _ungrouped(nodeid: str) -> str:
    """A test's name without the group that `--dist loadgroup` appends to it."""
    name, at, group = nodeid.rpartition("@")
    return name if at and "]" not in group else nodeid


class Recorder:
    """Notes what each test of one worker cost."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._seen: set[str] = set()
        sys.addaudithook(self._audit)

    def _audit(self, event: str, _arguments: tuple[object, ...]) -> None:
        if event in STARTS:
            self._seen.add("process")
        elif event in OPENS:
            self._seen.add("in-process")

    def _kind(self, item: pytest.Item) -> str:
        fixtures = set(getattr(item, "fixturenames", ()))
        for kind, names in BY_FIXTURE.items():
            if fixtures & names:
                return kind
        if item.nodeid.startswith("tests/docs/"):
            return "docs"
        if "process" in self._seen:
            return "process"
        return "in-process" if self._seen or "zenoh_router" in fixtures else "pure"

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Generator[None, object, object]:
        """Measure one test whole."""
        self._seen.clear()
        self._setup_s = 0.0
        cpu_s, began_s = _cpu_s(), time.monotonic()
        try:
            return (yield)
        finally:
            wall_s = time.monotonic() - began_s
            cost = Cost(_ungrouped(item.nodeid), self._kind(item), wall_s, self._setup_s, _cpu_s() - cpu_s)
            with self._path.open("a") as file:
                file.write(json.dumps(asdict(cost)) + "\n")

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Take the time of the set-up."""
        if report.when == "setup":
            self._setup_s = report.duration


def pytest_configure(config: pytest.Config) -> None:
    """In every process that runs tests; the controller of several workers runs none."""
    if getattr(config.option, "dist", "no") == "no" or hasattr(config, "workerinput"):
        worker = os.environ.get("PYTEST_XDIST_WORKER", "main")
        config.pluginmanager.register(Recorder(Path(os.environ[VARIABLE]) / f"{worker}.jsonl"))


def read(folder: Path) -> list[Cost]:
    """The costs that a run left in a folder."""
    return [
        Cost(**json.loads(line)) for file in sorted(folder.glob("*.jsonl")) for line in file.read_text().splitlines()
    ]


def _table(title: str, costs: Iterable[Cost], by: Callable[[Cost], str]) -> Table:
    table = Table("", "tests", "wall s", "CPU s", "waiting s", title=title, title_justify="left", box=None)
    for column in table.columns[1:]:
        column.justify = "right"
    groups: dict[str, list[Cost]] = defaultdict(list)
    for cost in costs:
        groups[by(cost)].append(cost)
    ranked = sorted(groups.items(), key=lambda group: -sum(cost.wall_s for cost in group[1]))
    whole = [("all", [cost for group in groups.values() for cost in group])]
    for name, group in ranked + whole:
        sums = (sum(c.wall_s for c in group), sum(c.cpu_s for c in group), sum(c.waiting_s for c in group))
        table.add_row(name, f"{len(group):,}", *(f"{value:,.1f}" for value in sums))
    return table


def report(costs: list[Cost], console: Console) -> None:
    """Print the three tables."""
    console.print(_table("By folder", costs, lambda cost: cost.folder), "")
    console.print(_table("By kind", costs, lambda cost: f"{cost.kind}: {KINDS[cost.kind]}"), "")
    table = Table("", "wall s", "set-up s", "CPU s", title=f"The {DEAREST} dearest", title_justify="left", box=None)
    table.columns[0].overflow = "fold"
    for cost in sorted(costs, key=lambda cost: -cost.wall_s)[:DEAREST]:
        table.add_row(cost.test, f"{cost.wall_s:.1f}", f"{cost.setup_s:.1f}", f"{cost.cpu_s:.1f}")
    console.print(table)


def main(arguments: list[str]) -> int:
    """Run pytest with `arguments` and print what it cost; its exit status."""
    status = 0
    folder = FOLDER
    if arguments[:1] == ["--read"]:
        folder = Path(arguments[1]) if arguments[1:] else FOLDER
    else:
        folder.mkdir(parents=True, exist_ok=True)
        for old in folder.glob("*.jsonl"):
            old.unlink()
        command = [sys.executable, "-m", "pytest", "-p", "tools.profile_tests", *arguments]
        status = subprocess.run(command, cwd=ROOT, env={**os.environ, VARIABLE: str(folder)}, check=False).returncode
    report(read(folder), Console(width=None if sys.stdout.isatty() else 180))
    return status


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
