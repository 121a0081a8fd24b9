"""`kill -9` of a supervised node: how long until its replacement's first message.

    python -m load_tests restart [--kills 30] [--cold]

A real `metaros launch` keeps a light node (one text topic), a node with arrays, which loads numpy, and the floor: bare
Python with eclipse-zenoh, no node at all. They are killed in turn, each when its replacement has settled; the time is
from the kill to the first message of another process id. The policy's wait before a first restart (0 to 50 ms, so
that a fleet does not restart in step) is part of it; so is what the launcher's warm spare saves, unless `--cold`.
Children may write byte code, as an installed package has it.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import signal
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Sequence
from pathlib import Path

import zenoh

from load_tests.figures import note
from tests.support.ports import free_port

__all__ = ["main", "run"]

_SETTLE_S = 1.0  # the launcher has its spare again
_PATIENCE_S = 30.0
NODES = {"light": "metaros node, texts", "arrays": "metaros node, arrays", "floor": "bare python + zenoh"}
TABLE = """
[[node]]
name = "light"
module = "bench_light"
restart = { healthy_after_s = 0.0, exits = 1000000 }

[[node]]
name = "arrays"
module = "bench_arrays"
restart = { healthy_after_s = 0.0, exits = 1000000 }

[[node]]
name = "floor"
command = [PYTHON, "bench_floor.py"]
heartbeat = false
restart = { healthy_after_s = 0.0, exits = 1000000 }
"""
LIGHT = """
import os
import metaros
from metaros.interfaces.std_msgs.msg import String

with metaros.Node("light") as node:
    publisher = node.create_publisher(String, "bench_light")
    say = lambda: publisher.publish(String(data=f"pid={os.getpid()};"))
    say()
    node.create_timer(0.02, say)
    metaros.spin(node)
"""
ARRAYS = """
import os
import metaros
from metaros.interfaces.sensor_msgs.msg import LaserScan

with metaros.Node("arrays") as node:
    publisher = node.create_publisher(LaserScan, "bench_arrays")
    scan = LaserScan(ranges=[1.0] * 360)
    scan.header.frame_id = f"pid={os.getpid()};"
    publisher.publish(scan)
    node.create_timer(0.02, lambda: publisher.publish(scan))
    metaros.spin(node)
"""
FLOOR = """
import json, os, time
import zenoh

config = zenoh.Config()
config.insert_json5("mode", '"client"')
config.insert_json5("connect/endpoints", json.dumps(["tcp/127.0.0.1:" + os.environ["METAROS_ZENOH_PORT"]]))
session = zenoh.open(config)
publisher = session.declare_publisher("0/bench_floor/x")
while True:
    publisher.put(f"pid={os.getpid()};")
    time.sleep(0.02)
"""
_PID = re.compile(rb"pid=(\d+);")


class Ears:
    """The newest process id heard on each topic, and when it was heard first."""

    def __init__(self, port: int) -> None:
        config = zenoh.Config()
        config.insert_json5("mode", '"client"')
        config.insert_json5("connect/endpoints", json.dumps([f"tcp/127.0.0.1:{port}"]))
        config.insert_json5("scouting/multicast/enabled", "false")
        self._received: dict[str, tuple[int, float]] = {}
        self._news = threading.Condition()
        self._session = zenoh.open(config)
        self._subscribers = [
            self._session.declare_subscriber(f"0/bench_{name}/**", lambda sample, name=name: self._hear(name, sample))
            for name in NODES
        ]

    def _hear(self, name: str, sample: zenoh.Sample) -> None:
        now = time.perf_counter()
        found = _PID.search(sample.payload.to_bytes())
        if found is None:
            return
        pid = int(found[1])
        with self._news:
            if self._received.get(name, (0, 0.0))[0] != pid:
                self._received[name] = (pid, now)
                self._news.notify_all()

    def other(self, name: str, than: int) -> tuple[int, float]:
        """Wait for another process on the topic: its id, and when its first message came."""
        with self._news:
            if not self._news.wait_for(lambda: self._received.get(name, (than, 0.0))[0] != than, _PATIENCE_S):
                raise TimeoutError(f"no replacement of {name} was heard within {_PATIENCE_S:.0f} s")
            return self._received[name]

    def close(self) -> None:
        """Hear no more."""
        self._session.close()


def run(*, kills: int, cold: bool = False) -> dict[str, list[float]]:
    """Seconds from the kill to the replacement's first message, by node."""
    port = free_port()
    env = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    with tempfile.TemporaryDirectory() as text:
        folder = Path(text)
        table = TABLE.replace("PYTHON", json.dumps(sys.executable))
        (folder / "bench.toml").write_text("spare = false\n" + table if cold else table)
        for name, code in (("light", LIGHT), ("arrays", ARRAYS), ("floor", FLOOR)):
            (folder / f"bench_{name}.py").write_text(code)
        command = [sys.executable, "-m", "metaros", "launch", str(folder / "bench.toml"), "--zenoh-port", str(port)]
        with (folder / "out").open("wb") as out:
            launcher = subprocess.Popen([*command, "--log-dir", text], stdout=out, stderr=out, env=env)
        try:
            return _measure(port, kills, launcher, folder / "out")
        finally:
            launcher.send_signal(signal.SIGINT)
            launcher.wait(_PATIENCE_S)


def _measure(port: int, kills: int, launcher: subprocess.Popen[bytes], log: Path) -> dict[str, list[float]]:
    ears = _listen(port, launcher, log)
    times: dict[str, list[float]] = {name: [] for name in NODES}
    try:
        pids = {name: ears.other(name, 0)[0] for name in NODES}
        for _ in range(kills):
            for name in NODES:
                time.sleep(_SETTLE_S)
                killed = time.perf_counter()
                os.kill(pids[name], signal.SIGKILL)
                pids[name], received = ears.other(name, pids[name])
                times[name].append(received - killed)
    finally:
        ears.close()
    return times


def _listen(port: int, launcher: subprocess.Popen[bytes], log: Path) -> Ears:
    """As soon as the launcher's router is there."""
    deadline = time.monotonic() + _PATIENCE_S
    while launcher.poll() is None and time.monotonic() < deadline:
        try:
            return Ears(port)
        except zenoh.ZError:
            time.sleep(0.05)
    raise RuntimeError(f"the launcher did not start: {log.read_text(errors='replace')}")


def main(argv: Sequence[str] = ()) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--kills", type=int, default=30, help="of each node")
    parser.add_argument("--cold", action="store_true", help="no warm spare: every replacement imports all it needs")
    options = parser.parse_args(list(argv))
    print(f"{'kill -9 to first message':<26}{'n':>5}{'p50 ms':>9}{'p95 ms':>9}{'max ms':>9}")
    p95s: dict[str, float] = {}
    for name, seconds in run(kills=options.kills, cold=options.cold).items():
        p50, p95 = statistics.median(seconds), statistics.quantiles(seconds, n=20, method="inclusive")[-1]
        p95s[name] = p95 * 1000
        figures = "".join(f"{value * 1000:>9.0f}" for value in (p50, p95, max(seconds)))
        print(f"{NODES[name]:<26}{len(seconds):>5}{figures}")
    note("kill -9 to first message, p95", [p95s["light"]], peer=[p95s["floor"]])
    load = f", load {os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else ""
    spare = "no spare" if options.cold else "a warm spare"
    print(f"in turn, {spare}, 0-50 ms of the restart policy included; {os.cpu_count()} cores{load}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
