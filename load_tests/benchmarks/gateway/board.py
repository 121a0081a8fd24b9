"""What an agent costs a small board: memory, processor and flash, with the settings it has when nobody sets any.

    python -m load_tests board [--warm 30] [--seconds 120] [--rounds 3] [--quick]

The agent, held to one core, taps ten topics of 10 Hz (odometry, scan, IMU, battery, …) and forwards every sample to a
gateway on the same machine, where a viewer takes them; the publishers are another process. *Resident* is what the
kernel says of the process (`smaps_rollup`: RSS, shared libraries counted whole) and what its black box holds in memory
when its five minutes are full, as far as it has grown by then. *Written* is what the process made the kernel write
(`/proc/PID/io`), for an hour of the same; the file system's journal comes on top. Before that the same is measured with
nobody watching, and that is the figure of what is written: a robot is watched for a while. The floor is a bare Python
with eclipse-zenoh and grpc.aio, a session and a channel open. Linux only.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import NamedTuple

import numpy as np

from load_tests.benchmarks.gateway.idle import cpu_s
from load_tests.figures import note
from tests.support.gateways.viewer import open_socket, subscribe
from tests.support.ports import free_port

__all__ = ["main", "publish"]

RATE_HZ, TOPICS = 10, 10
ROBOT = "board"
WINDOW_S = 300.0  # of the black box
PATIENCE_S = 60.0
FLOOR = """
import asyncio, sys, zenoh, grpc.aio
async def main():
    session = zenoh.open(zenoh.Config.from_json5('{mode: "client", connect: {endpoints: ["tcp/127.0.0.1:%s"]}}'))
    channel = grpc.aio.insecure_channel("127.0.0.1:%s")
    await channel.channel_ready()
    print("ready", flush=True)
    await asyncio.sleep(3600)
asyncio.run(main())
"""


class State(NamedTuple):
    """Of a process at one moment."""

    at_s: float
    cpu_s: float
    written: int
    box: int


def publish(port: int) -> None:
    """Ten topics until killed; a program of its own."""
    import metaros
    from metaros.interfaces.geometry_msgs.msg import PoseStamped, TwistStamped
    from metaros.interfaces.nav_msgs.msg import Odometry
    from metaros.interfaces.sensor_msgs.msg import BatteryState, Imu, JointState, LaserScan, NavSatFix, Temperature
    from metaros.interfaces.tf2_msgs.msg import TFMessage

    kinds = {
        "odom": Odometry(),
        "scan": LaserScan(ranges=[1.0] * 360),
        "imu": Imu(),
        "battery_state": BatteryState(),
        "motor_temperature": Temperature(),
        "tf": TFMessage(),
        "joint_states": JointState(name=[f"joint_{n}" for n in range(6)], position=[0.1] * 6),
        "fix": NavSatFix(),
        "pose": PoseStamped(),
        "speed": TwistStamped(),
    }
    with metaros.Context(connect=f"tcp/127.0.0.1:{port}") as context:
        node = metaros.Node("sensors", namespace=f"/{ROBOT}", context=context)
        publishers = [(node.create_publisher(type(message), name, 10), message) for name, message in kinds.items()]
        begin_s, number = time.monotonic(), 0
        while True:  # each topic at a moment of its own
            for publisher, message in publishers:
                number += 1
                time.sleep(max(0.0, begin_s + number / (RATE_HZ * TOPICS) - time.monotonic()))
                if hasattr(message, "header"):
                    message.header.stamp.nanosec = number
                if isinstance(message, LaserScan):
                    message.ranges = (np.arange(360) / 360 + number % 97 / 7).astype(np.float32)
                if isinstance(message, BatteryState):
                    message.voltage, message.percentage = 24.0 + number % 7 / 10, number % 101 / 100
                publisher.publish(message)


@contextmanager
def _program(folder: Path, name: str, *command: str, core: int | None = None) -> Iterator[subprocess.Popen[bytes]]:
    kept = {key: value for key, value in os.environ.items() if not key.startswith(("METAROS_", "PYTHON"))}
    env = {**kept, "HOME": str(folder), "METAROS_RUNTIME_DIR": str(folder / "run")}
    with (folder / f"{name}.log").open("wb") as out:
        process = subprocess.Popen(
            [sys.executable, *command], stdin=subprocess.DEVNULL, stdout=out, stderr=out, env=env
        )
    if core is not None:
        os.sched_setaffinity(process.pid, {core})
    try:
        yield process
    finally:
        process.send_signal(signal.SIGINT)
        try:
            process.wait(PATIENCE_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def _until(folder: Path, name: str, process: subprocess.Popen[bytes], file: Path) -> None:
    end_s = time.monotonic() + PATIENCE_S
    while not file.exists() or not file.stat().st_size:
        if process.poll() is not None or time.monotonic() > end_s:
            raise RuntimeError(f"{name} did not start: {(folder / f'{name}.log').read_text()[-2000:]}")
        time.sleep(0.1)


def _resident(pid: int, kind: str = "Rss") -> float:
    """MB."""
    lines = Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()
    return next(int(line.split()[1]) * 1024 / 1e6 for line in lines if line.startswith(f"{kind}:"))


def _state(pid: int, folder: Path) -> State:
    written = next(
        int(line.split()[1]) for line in Path(f"/proc/{pid}/io").read_text().splitlines() if line.startswith("write_b")
    )
    where = folder / "agent" / "black_box" / "memory"
    box = sum(path.stat().st_size for path in where.glob("*")) if where.is_dir() else 0
    return State(time.monotonic(), cpu_s(pid), written, box)


def _measure(pid: int, folder: Path, seconds: float) -> tuple[float, float, float]:
    """Percent of a core, MB that are written an hour, MB of the full black box."""
    before = _state(pid, folder)
    time.sleep(seconds)
    after = _state(pid, folder)
    span_s = after.at_s - before.at_s
    grown = max(0, after.box - before.box) / span_s * WINDOW_S
    cpu = 100 * (after.cpu_s - before.cpu_s) / span_s
    return cpu, (after.written - before.written) / span_s * 3600 / 1e6, max(grown, after.box) / 1e6


@contextmanager
def _viewer(folder: Path, url: str) -> Iterator[list[int]]:
    """Takes every sample; how many came, in a list of one."""
    key = (folder / "data" / "local.key").read_text().strip()
    count = [0]
    with open_socket(url, "/api/v1/stream", key=key) as socket:
        subscribe(socket, 1, ROBOT, "**")

        def take() -> None:
            for frame in socket:
                count[0] += len(frame)

        thread = threading.Thread(target=take, daemon=True)
        thread.start()
        yield count
    thread.join(PATIENCE_S)


def main(argv: Sequence[str] = ()) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--warm", type=float, default=30.0, help="seconds before the first round")
    parser.add_argument("--seconds", type=float, default=120.0, help="of a round")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--quick", action="store_true", help="one short round, to see that it runs")
    options = parser.parse_args(list(argv))
    if options.quick:
        options.warm, options.seconds, options.rounds = 5.0, 10.0, 1
    zenoh, http, grpc = free_port(), free_port(), free_port()
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="metaros-board-")))
        ready = {name: folder / f"{name}.json" for name in ("router", "gateway", "agent")}

        def start(name: str, *words: str, core: int | None = None) -> subprocess.Popen[bytes]:
            command = ("-m", "metaros", name, *words, "--status-file", str(ready[name]))
            process = stack.enter_context(_program(folder, name, *command, core=core))
            _until(folder, name, process, ready[name])
            return process

        start("router", "--port", str(zenoh))
        start("gateway", "--port", str(http), "--grpc-port", str(grpc), "--data-dir", str(folder / "data"))
        where = ("--gateway", f"127.0.0.1:{grpc}", "--zenoh-port", str(zenoh), "--state-dir", str(folder / "agent"))
        agent = start("agent", "--name", ROBOT, "--namespace", f"/{ROBOT}", *where, "--no-host-metrics", core=0)
        source = f"from load_tests.benchmarks.gateway.board import publish; publish({zenoh})"
        stack.enter_context(_program(folder, "sensors", "-c", source))
        floor = stack.enter_context(_program(folder, "floor", "-c", FLOOR % (zenoh, grpc)))
        _until(folder, "floor", floor, folder / "floor.log")
        time.sleep(options.warm)
        rounds: dict[str, list[tuple[float, float, float]]] = {"nobody watches": [], "all forwarded": []}
        resident, sizes, came = [], [], []
        for _ in range(options.rounds):
            rounds["nobody watches"].append(_measure(agent.pid, folder, options.seconds))
            with _viewer(folder, f"http://127.0.0.1:{http}") as count:
                time.sleep(2.0)
                before = count[0]
                rounds["all forwarded"].append(_measure(agent.pid, folder, options.seconds))
                came.append((count[0] - before) / options.seconds)
            resident.append(_resident(agent.pid))
            sizes.append(resident[-1] + rounds["all forwarded"][-1][2])
        bare = _resident(floor.pid)
        pss = _resident(agent.pid, "Pss")
        log = json.loads(ready["agent"].read_text())
    if not min(came):
        print(f"nothing was forwarded: {log}")
        return 1
    print(f"{'':<18}{'% of a core':>13}{'MB/h written':>14}{'MB of black box':>17}")
    for name, found in rounds.items():
        cpu, written, box = (statistics.median(values) for values in zip(*found, strict=True))
        print(f"{name:<18}{cpu:>13.2f}{written:>14.1f}{box:>17.1f}")
    print(f"resident {statistics.median(resident):.1f} MB (PSS {pss:.1f}), the floor's {bare:.1f} MB")
    print(f"{options.rounds} rounds of {options.seconds:g} s; viewer {statistics.median(came) / 1e3:.0f} kB/s")
    note("agent, resident", sizes, peer=[bare])
    note("agent, 10 topics of 10 Hz", [cpu for cpu, _, _ in rounds["all forwarded"]])
    note("agent, written to flash an hour", [written for _, written, _ in rounds["nobody watches"]])
    note("agent, written to flash an hour of being watched", [written for _, written, _ in rounds["all forwarded"]])
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
