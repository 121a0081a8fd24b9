"""The fair executor's real shares and a critical node's timer beside them, with the default executor for comparison.

    python -m load_tests executor [--seconds 10]

Three nodes compute without pause, at nice -5, 0 and 5. A fourth has a 100 Hz timer; measured is how far each call is
from when it was due. On the fair executor that node is critical; on the default one it shares the thread. Then the same
with callbacks that take longer. Each row is a process of its own.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from typing import Any

import metaros
from load_tests.figures import note
from metaros.executor import SingleThreadedExecutor
from metaros.executor.fair_schedule import weight_of

__all__ = ["main", "run"]

LEVELS = (-5, 0, 5)
TICK_S = 0.01
GOAL_S = 0.002
_WARM_UP_S = 0.5
BURST_S = {"1 ms": 0.001, "5 ms": 0.005}


def run(*, seconds: float) -> dict[tuple[str, str], dict[str, Any]]:
    """Shares and jitter of every (executor, length of the busy callbacks)."""
    found = {}
    for burst in BURST_S:
        for kind in ("fair", "default"):
            command = [sys.executable, "-m", "load_tests.benchmarks.library.executor", "--seconds", str(seconds)]
            done = subprocess.run([*command, "--role", kind, "--burst", burst], stdout=subprocess.PIPE, check=True)
            found[kind, burst] = json.loads(done.stdout)
    return found


def _burn(seconds: float) -> None:
    """CPU time of this thread."""
    end_s = time.thread_time() + seconds
    while time.thread_time() < end_s:
        pass


def _measure(kind: str, burst_s: float, seconds: float) -> dict[str, Any]:
    """One executor under load."""
    context = metaros.Context(domain_id=0, connect=[])
    busy = [metaros.Node(f"busy_{number}", context=context, nice=nice) for number, nice in enumerate(LEVELS)]
    critical = metaros.Node("control", context=context, critical=True)
    run_s = [0.0] * len(LEVELS)

    def compute(number: int) -> None:
        before_s = time.thread_time()
        _burn(burst_s)
        run_s[number] += time.thread_time() - before_s

    for number, node in enumerate(busy):
        node.create_timer(burst_s / 10, lambda number=number: compute(number))  # type: ignore[misc]
    calls_s: list[float] = []
    timer = critical.create_timer(TICK_S, lambda: calls_s.append(time.monotonic()))
    origin_s = timer.due_s
    executor = metaros.FairExecutor() if kind == "fair" else SingleThreadedExecutor()
    for node in (*busy, critical):
        executor.add_node(node)
    threading.Thread(target=executor.spin, daemon=True).start()
    time.sleep(_WARM_UP_S)
    calls_s.clear()
    before = list(run_s)
    time.sleep(seconds)
    spent = [after - was for after, was in zip(run_s, before, strict=True)]
    late_s = sorted((call_s - origin_s) % TICK_S for call_s in list(calls_s))
    realtime = executor.report()[-1].realtime if isinstance(executor, metaros.FairExecutor) else ""
    executor.shutdown()
    context.close()
    return {
        "shares": [part / sum(spent) for part in spent],
        "p50_s": late_s[len(late_s) // 2],
        "p99_s": late_s[int(len(late_s) * 0.99)],
        "max_s": late_s[-1],
        "calls": len(late_s) / (seconds / TICK_S),
        "realtime": realtime,
    }


def main(argv: Sequence[str] = ()) -> int:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--seconds", type=float, default=10.0, help="measured time a row")
    parser.add_argument("--role", help=argparse.SUPPRESS)
    parser.add_argument("--burst", default="1 ms", help=argparse.SUPPRESS)
    options = parser.parse_args(list(argv))
    if options.role:
        print(json.dumps(_measure(options.role, BURST_S[options.burst], options.seconds)))
        return 0
    found = run(seconds=options.seconds)
    weights = [weight_of(nice) for nice in LEVELS]
    ideal = [weight / sum(weights) for weight in weights]
    print(f"{'executor':<10}{'callback':<10}" + "".join(f"{f'nice {nice}':>10}" for nice in LEVELS), end="")
    print(f"{'p50 ms':>10}{'p99 ms':>10}{'max ms':>10}{'calls':>8}  real-time class")
    late = {kind: found[kind, "1 ms"]["p99_s"] * 1000 for kind in ("fair", "default")}
    note("critical timer p99, fair executor", [late["fair"]], peer=[late["default"]])
    pairs = zip(found["fair", "1 ms"]["shares"], ideal, strict=True)
    note("largest error of a share, 1 ms callbacks", [100 * max(abs(part - due) / due for part, due in pairs)])
    print(f"{'(weights)':<20}" + "".join(f"{part:>10.4f}" for part in ideal))
    for (kind, burst), row in found.items():
        print(f"{kind:<10}{burst:<10}" + "".join(f"{part:>10.4f}" for part in row["shares"]), end="")
        print("".join(f"{row[name] * 1e3:>10.3f}" for name in ("p50_s", "p99_s", "max_s")), end="")
        print(f"{row['calls']:>8.0%}  {row['realtime'] or '-'}")
    fair = [row for (kind, _), row in found.items() if kind == "fair"]
    off = max(abs(part / goal - 1) for row in fair for part, goal in zip(row["shares"], ideal, strict=True))
    worst_s = max(row["p99_s"] for row in fair)
    print(f"shares at most {off:.1%} from the weights (goal 5 %), p99 at most {worst_s * 1e3:.3f} ms (goal 2 ms)")
    print(f"{options.seconds:g} s a row on {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
