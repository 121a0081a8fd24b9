"""How long programs take to start, and what of the processor, as multiples of `python -c pass` in the same rounds.

    python -m load_tests start [--rounds 7] [--tree DIR] [--only NAME …]

`--tree` starts the programs of another copy of this repository as well, turn about with these: what a change makes of
them. A copy with a `.venv` of its own is run by that one's Python. The first round compiles modules and counts for
nothing. `metaros topic list` finds no router; the gateway has started when its status file is there, and all of
`metaros up` when it says so. What that one costs the processor is spread over its processes, and not told.
"""

from __future__ import annotations

import argparse
import os
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from load_tests.figures import note
from tests.support.ports import free_port

__all__ = ["PROGRAMS", "Tree", "main", "measure", "wait_for"]

HERE = Path(__file__).resolve().parents[3]
FLOOR = "python -c pass"
WALL, CPU = 0, 1
PATIENCE_S = 120.0
LOOK_S = 0.002
Start = Callable[["Tree", Path], tuple[float, float]]  # seconds of the wall's clock, and of the processor


@dataclass(frozen=True, slots=True)
class Tree:
    """A copy of the repository, and what was measured of it: by program a pair of seconds a round."""

    folder: Path
    found: dict[str, list[tuple[float, float]]] = field(default_factory=dict)

    @property
    def python(self) -> str:
        """Who runs its programs."""
        own = self.folder / ".venv" / "bin" / "python"
        return str(own) if own.exists() else sys.executable

    def command(self, *arguments: str) -> list[str]:
        """`metaros ARGUMENTS` of this copy."""
        return [self.python, "-m", "metaros", *arguments]

    def environ(self, folder: Path) -> dict[str, str]:
        """Nothing of the user's, and modules of this copy alone, which keep their byte code."""
        kept = {name: value for name, value in os.environ.items() if not name.startswith(("METAROS_", "PYTHON"))}
        own = {"HOME": str(folder), "METAROS_RUNTIME_DIR": str(folder / "run"), "PYTHONPATH": str(self.folder)}
        return {**kept, **own, "METAROS_ZENOH_PORT": str(free_port())}

    def ratio(self, program: str, kind: int) -> float:
        """Of the medians, program ÷ floor."""
        return self.median(program, kind) / self.median(FLOOR, kind)

    def median(self, program: str, kind: int) -> float:
        """Seconds of the wall's clock, or of the processor."""
        return statistics.median(pair[kind] for pair in self.found[program])


def _ended(*arguments: str) -> Start:
    """A program that is over when it has said what it has to say."""

    def start(tree: Tree, folder: Path) -> tuple[float, float]:
        command = tree.command(*arguments) if arguments else [tree.python, "-c", "pass"]
        began_s = time.perf_counter()
        process = _started(tree, folder, command, subprocess.DEVNULL)
        _, _, used = os.wait4(process.pid, 0)
        took_s = time.perf_counter() - began_s
        process.returncode = 0  # waited for
        return took_s, used.ru_utime + used.ru_stime

    return start


def _gateway(tree: Tree, folder: Path) -> tuple[float, float]:
    status, ports = folder / "status.json", [f"--{name}port=0" for name in ("", "grpc-", "api-grpc-")]
    where = ("--data-dir", str(folder / "data"), "--status-file", str(status))
    command = tree.command("gateway", *where, *ports, "--foxglove-port=0", "--rosbridge-port=0")
    began_s = time.perf_counter()
    process = _started(tree, folder, command, subprocess.DEVNULL)
    try:
        wait_for(process, status.exists)
        return time.perf_counter() - began_s, _used_s(process.pid)
    finally:
        _end(process)


def _up(tree: Tree, folder: Path) -> tuple[float, float]:
    ports = [f"--{name}={free_port()}" for name in ("port", "grpc-port", "zenoh-port")]
    out = folder / "out"
    with out.open("wb") as file:
        began_s = time.perf_counter()
        command = tree.command("up", "--robots=3", "--data-dir", str(folder / "data"), *ports)
        process = _started(tree, folder, command, file.fileno())
    try:
        wait_for(process, lambda: b"Ready" in out.read_bytes())
        return time.perf_counter() - began_s, float("nan")
    finally:
        _end(process)


def _started(tree: Tree, folder: Path, command: Sequence[str], out: int) -> subprocess.Popen[bytes]:
    quiet = subprocess.DEVNULL
    return subprocess.Popen(
        command, stdin=quiet, stdout=out, stderr=quiet, cwd=folder, env=tree.environ(folder), start_new_session=True
    )


def wait_for(process: subprocess.Popen[bytes], ready: Callable[[], bool]) -> None:
    """Look often; RuntimeError for one that ends, or takes too long."""
    end_s = time.monotonic() + PATIENCE_S
    while not ready():
        if process.poll() is not None or time.monotonic() > end_s:
            raise RuntimeError(f"{' '.join(map(str, process.args))} did not start")  # type: ignore[arg-type]
        time.sleep(LOOK_S)


def _end(process: subprocess.Popen[bytes]) -> None:
    process.send_signal(signal.SIGINT)
    process.wait(PATIENCE_S)


def _used_s(pid: int) -> float:
    """Of the processor so far; a number that is none where there is no /proc."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return float("nan")
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


PROGRAMS: dict[str, Start] = {
    FLOOR: _ended(),
    "metaros --help": _ended("--help"),
    "metaros topic list": _ended("topic", "list"),
    "metaros gateway": _gateway,
    "metaros up": _up,
}


def measure(trees: Sequence[Tree], *, rounds: int, programs: Sequence[str]) -> None:
    """Start them in turn, so that what else the machine does meets all alike."""
    for number in range(rounds + 1):
        for program in (FLOOR, *programs):
            for tree in trees:
                with tempfile.TemporaryDirectory(prefix="mrstart") as name:
                    taken = PROGRAMS[program](tree, Path(name))
                if number:
                    tree.found.setdefault(program, []).append(taken)


def main(argv: Sequence[str] = ()) -> int:
    """Print the table."""
    names = [name for name in PROGRAMS if name != FLOOR]
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--tree", type=Path, help="another copy of the repository, from before a change")
    parser.add_argument("--only", nargs="+", choices=names, default=names, metavar="PROGRAM")
    options = parser.parse_args(list(argv))
    here = Tree(HERE)
    trees = [here] if options.tree is None else [Tree(options.tree.resolve()), here]
    measure(trees, rounds=options.rounds, programs=options.only)
    print(f"{'to its end, or ready':<22}{'tree':<26}{'s':>8}{'× pass':>9}{'CPU s':>9}{'× pass':>9}")
    for program in (FLOOR, *options.only):
        for tree in trees:
            taken, used = ((tree.median(program, kind), tree.ratio(program, kind)) for kind in (WALL, CPU))
            cells = "".join(
                f"{seconds:>{width}.3f}{ratio:>9.1f}" for (seconds, ratio), width in ((taken, 8), (used, 9))
            )
            print(f"{program:<22}{str(tree.folder)[-24:]:<26}{cells}")
    for program in options.only:
        floor_s = here.median(FLOOR, WALL)
        note(f"{program}, of {FLOOR}", [pair[WALL] / floor_s for pair in here.found[program]])
    load = f", load {os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else ""
    print(f"medians of {options.rounds} interleaved rounds; {os.cpu_count()} cores{load}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
