"""The suite itself, again and again: a test that fails once in ten runs has a race, or its subject has.

    make campaign ARGS="steady --runs 10 --beside 3"
    make campaign ARGS="steady --runs 3 --beside 1 --all"

The first runs go on beside two processes that never rest, at the same priority: they find the most, and so at once.
Nothing is tried again. What a run that failed has printed is kept in `.make/steady`, whole.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

__all__ = ["main"]

ROOT = Path(__file__).resolve().parents[2]
KEPT = ROOT / ".make" / "steady"
BUSY_PROCESSES = 2


def main(argv: list[str]) -> int:
    """Run the suite so many times; 1 when a run failed."""
    parser = argparse.ArgumentParser(prog="campaign steady", description=__doc__)
    parser.add_argument("--runs", type=int, default=10)
    parser.add_argument("--beside", type=int, default=3, help="how many of them beside busy processes")
    parser.add_argument("--all", action="store_true", help="CI's tests, not only the plain ones")
    options = parser.parse_args(argv)
    failed = 0
    for number in range(1, options.runs + 1):
        busy = number <= options.beside
        began_s = time.monotonic()
        with _busy(BUSY_PROCESSES if busy else 0):
            passed = _passes(number, everything=options.all)
        failed += not passed
        beside = f" beside {BUSY_PROCESSES} busy processes" if busy else ""
        print(f"  run {number}: {'PASS' if passed else 'FAIL'}, {time.monotonic() - began_s:.0f} s{beside}", flush=True)
    print(f"  {'FAIL' if failed else 'PASS'}: {failed} of {options.runs} runs failed", flush=True)
    return int(bool(failed))


def _passes(number: int, *, everything: bool) -> bool:
    env = {**os.environ, "CI": "true"} if everything else {k: v for k, v in os.environ.items() if k != "CI"}
    done = subprocess.run(["make", "test", "ARGS=-q"], cwd=ROOT, env=env, stdout=subprocess.PIPE, text=True)
    if done.returncode:
        KEPT.mkdir(parents=True, exist_ok=True)
        kept = KEPT / f"{time.strftime('%Y%m%d-%H%M%S')}-run-{number}.txt"
        kept.write_text(done.stdout)
        print(done.stdout[-20_000:] + f"  all of it: {kept}", flush=True)
    return done.returncode == 0


@contextmanager
def _busy(count: int) -> Iterator[None]:
    processes = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(count)]
    try:
        yield
    finally:
        for process in processes:
            process.kill()
            process.wait()
