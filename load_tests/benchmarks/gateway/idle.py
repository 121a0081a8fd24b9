"""What `metaros up` costs while nobody watches: simulated robots, their agents and the gateway, as a user starts them.

    python -m load_tests idle [--robots 3] [--warm 20] [--seconds 60] [--rounds 3] [--quick]

All of it runs on this machine; no browser is open, and nothing is asked while it is measured. CPU time is what the
kernel gave each process with all its threads (`/proc/PID/stat`), in percent of one core; of the agents the worst
counts. The floor, which no agent in Python can be below, is a bare eclipse-zenoh subscriber of all that the first robot
publishes, which forgets it once a second. Each round is a window of the same run. Linux only.
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
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from load_tests.figures import note
from tests.support.ports import free_port

__all__ = ["cpu_s", "main", "processes_of"]

PATIENCE_S = 120.0
LOOK_S = 0.1
FLOOR = """
import queue, time, zenoh
came = queue.SimpleQueue()
text = '{mode: "peer", connect: {endpoints: ["tcp/127.0.0.1:%s"]}, scouting: {multicast: {enabled: false}}}'
session = zenoh.open(zenoh.Config.from_json5(text))
subscriber = session.declare_subscriber("0/sim_1/**", came.put)
while True:
    time.sleep(1)
    print(came.qsize(), flush=True)
    while not came.empty():
        came.get()
"""
TICKS_PER_S = os.sysconf("SC_CLK_TCK")


def cpu_s(pid: int) -> float:
    """Of the processor so far, all threads."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / TICKS_PER_S


def processes_of(pid: int) -> dict[str, int]:
    """What `metaros up` has started, however deep: `gateway`, `sim`, `router`, and an agent by its robot's name."""
    found: dict[str, int] = {}
    waiting = [pid]
    while waiting:
        parent = waiting.pop()
        for children in Path(f"/proc/{parent}/task").glob("*/children"):
            waiting.extend(int(child) for child in children.read_text().split())
        words = Path(f"/proc/{parent}/cmdline").read_text().split("\0")
        if parent != pid and "metaros" in words[:4]:
            noun = words[words.index("metaros") + 1]
            found[f"agent {words[words.index('--name') + 1]}" if noun == "agent" else noun] = parent
    return found


@contextmanager
def _up(folder: Path, robots: int) -> Iterator[dict[str, int]]:
    """Everything, ready; its processes by name."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("METAROS_", "PYTHON"))}
    own = {"HOME": str(folder), "METAROS_RUNTIME_DIR": str(folder / "run")}
    zenoh = free_port()
    ports = [f"--zenoh-port={zenoh}", *(f"--{name}={free_port()}" for name in ("port", "grpc-port"))]
    command = [sys.executable, "-m", "metaros", "up", f"--robots={robots}", "--data-dir", str(folder / "data"), *ports]
    out = folder / "out"
    with out.open("wb") as file:
        process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=file, stderr=file, env={**kept, **own})
    try:
        end_s = time.monotonic() + PATIENCE_S
        while b"Ready" not in out.read_bytes():
            if process.poll() is not None or time.monotonic() > end_s:
                raise RuntimeError(f"metaros up did not start: {out.read_text()[-2000:]}")
            time.sleep(LOOK_S)
        floor = subprocess.Popen([sys.executable, "-c", FLOOR % zenoh], stdout=subprocess.PIPE)
        try:
            yield {"up": process.pid, "floor": floor.pid, **processes_of(process.pid)}
        finally:
            floor.kill()
            said = floor.communicate()[0].split()
            print(f"the floor took {statistics.median(map(int, said)) if said else 0:g} samples a second")
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(PATIENCE_S)


def _window(processes: dict[str, int], seconds: float) -> dict[str, float]:
    """Percent of a core of each, over so many seconds."""
    began_s, before = time.monotonic(), {name: cpu_s(pid) for name, pid in processes.items()}
    time.sleep(seconds)
    spent = {name: cpu_s(pid) - before[name] for name, pid in processes.items()}
    return {name: 100 * used / (time.monotonic() - began_s) for name, used in spent.items()}


def main(argv: Sequence[str] = ()) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--robots", type=int, default=3)
    parser.add_argument("--warm", type=float, default=20.0, help="seconds from being ready to the first round")
    parser.add_argument("--seconds", type=float, default=60.0, help="of a round")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--quick", action="store_true", help="one short round, to see that it runs")
    options = parser.parse_args(list(argv))
    if options.quick:
        options.warm, options.seconds, options.rounds = 5.0, 10.0, 1
    with tempfile.TemporaryDirectory(prefix="metaros-idle-") as name, _up(Path(name), options.robots) as processes:
        time.sleep(options.warm)
        rounds = [_window(processes, options.seconds) for _ in range(options.rounds)]
    print(f"{'% of a core':<28}{'median':>8}{'least':>8}{'most':>8}")
    for process in sorted(processes):
        shares = [one[process] for one in rounds]
        print(f"{process:<28}{statistics.median(shares):>8.2f}{min(shares):>8.2f}{max(shares):>8.2f}")
    worst = [max(share for process, share in one.items() if process.startswith("agent sim_")) for one in rounds]
    note("an agent, nobody watching", worst, peer=[one["floor"] for one in rounds])
    note("the gateway, nobody watching", [one["gateway"] for one in rounds])
    note("the simulator, nobody watching", [one["sim"] for one in rounds])
    print(f"worst agent {statistics.median(worst):.2f} %; {options.rounds} rounds of {options.seconds:g} s")
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
