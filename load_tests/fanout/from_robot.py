"""JSON from a robot's link to viewers, beside what rosbridge took for the same on another machine.

Nothing of the load is made in the measured process: a robot of its own brings it over a real link, as rospy's publisher
did over TCPROS when rosbridge was measured. To compare machines, foxglove-sdk sends what it sent on that one, in the
same rounds: ratios are printed as they are, and multiplied with how many times more CPU the SDK takes here. What so
many writes cost without any server around them (bare.py) is measured beside it: nobody who writes as often is below.
"""

from __future__ import annotations

import functools
import statistics
import tempfile
from collections.abc import Callable, Iterable
from contextlib import ExitStack

from load_tests.fanout.client import FoxgloveViewer, JsonViewer, RosbridgeViewer, StreamViewer, Viewer
from load_tests.fanout.load import Load
from load_tests.fanout.measure import Process, Server, median
from load_tests.fanout.table import Table, print_table
from load_tests.figures import note

__all__ = ["from_robot"]

SIZE = 64
# Of rosbridge (ROS 1, 55a6bdb), µs of CPU a delivery, by messages a second and viewers; see benchmarks.md.
ROSBRIDGE_US = {(1000, 10): 49.0, (100, 100): 55.0}
# Of foxglove-sdk on that machine, cores; as shipped and with a client that acknowledges at once.
SDK_CORES = {False: 0.52, True: 0.61}
SDK_RATE, SDK_VIEWERS = 2000, 100
ENDPOINT, NOTED_MS = "rosbridge endpoint", 5  # the figure that is noted: theirs at our default tick
KINDS: dict[str, Callable[[int], Viewer]] = {
    ENDPOINT: functools.partial(RosbridgeViewer, size=SIZE),
    "stream, JSON": functools.partial(JsonViewer, size=SIZE),
}
BARE = functools.partial(StreamViewer, size=SIZE)

Rows = Iterable[tuple[int, int]]


def from_robot(*, rounds: int, seconds: float, ticks_ms: Iterable[int], rows: Rows, pin: bool) -> None:
    """Measure and print; `rows` are keys of ROSBRIDGE_US."""
    tables: dict[tuple[int, int], Table] = {row: {} for row in rows}
    calibration: dict[bool, list[float]] = {quickack: [] for quickack in SDK_CORES}
    with ExitStack() as stack:
        sdk = Server("sdk", *(["--core", "0"] if pin else []))
        stack.callback(sdk.stop)
        pairs = {tick_ms: _with_robot(stack, tick_ms, pin=pin) for tick_ms in ticks_ms}
        bare = {tick_ms: _bare(stack, tick_ms, pin=pin) for tick_ms in pairs}
        for _ in range(rounds):
            for quickack, found in calibration.items():
                found.append(_calibrate(sdk, seconds, quickack=quickack))
            for (rate, viewers), table in tables.items():
                for tick_ms, (gateway, robot) in pairs.items():
                    for name, kind in KINDS.items():
                        figures = gateway.run(Load(seconds, rate, SIZE), viewers, kind, publisher=robot)
                        table.setdefault(f"gateway, {tick_ms} ms, {name}", []).append(figures)
                    figures = bare[tick_ms].run(Load(seconds, rate, SIZE), viewers, BARE)
                    table.setdefault(f"bare writes, {tick_ms} ms", []).append(figures)
    slower = _print_calibration(calibration)
    for row, table in tables.items():
        _print_row(row, table, slower)


def _with_robot(stack: ExitStack, tick_ms: int, *, pin: bool) -> tuple[Server, Process]:
    gateway = Server("servers", "--tick-ms", str(tick_ms), *(["--core", "0"] if pin else []))
    stack.callback(gateway.stop)
    folder = stack.enter_context(tempfile.TemporaryDirectory())
    robot = Process("robot", folder, str(gateway.robot_port), *(["--core", "1"] if pin else []))
    stack.callback(robot.stop)
    return gateway, robot


def _bare(stack: ExitStack, tick_ms: int, *, pin: bool) -> Server:
    server = Server("bare", "--tick-ms", str(tick_ms), *(["--core", "0"] if pin else []))
    stack.callback(server.stop)
    return server


def _calibrate(sdk: Server, seconds: float, *, quickack: bool) -> float:
    """The cores that the SDK takes here for what it was given there."""
    kind = functools.partial(FoxgloveViewer, size=SIZE)
    figures = sdk.run(Load(seconds, SDK_RATE, SIZE), SDK_VIEWERS, kind, quickack=quickack)
    return figures.cores / figures.delivered


def _print_calibration(calibration: dict[bool, list[float]]) -> float:
    """How many times the CPU of that machine this one takes now."""
    slower = []
    print(f"\nthis machine beside that of rosbridge's figures: foxglove-sdk, {SIZE} B, {SDK_RATE}/s to {SDK_VIEWERS}")
    for quickack, theirs in SDK_CORES.items():
        ours = statistics.median(calibration[quickack])
        slower.append(ours / theirs)
        least, most = min(calibration[quickack]), max(calibration[quickack])
        name = "quickack" if quickack else "as shipped"
        print(f"* {name}: {ours:.3f} cores ({least:.3f}–{most:.3f}), there {theirs}: {ours / theirs:.2f} times as many")
    mean = statistics.mean(slower)
    print(f"* so this machine, now, takes {mean:.2f} times the CPU; `calibrated` is `raw` times that")
    return mean


def _print_row(row: tuple[int, int], table: Table, slower: float) -> None:
    rate, viewers = row
    theirs = ROSBRIDGE_US[row]
    title = f"JSON, {SIZE} B, {rate}/s of a robot's link to {viewers}; rosbridge of ROS 1: {theirs:g} µs a delivery"
    print_table(title, table, rate)
    print("\n| deliveries a core ÷ rosbridge's | raw | calibrated |\n|---|---|---|")
    for name, runs in table.items():
        raw = theirs / median(runs, "us_a_delivery")
        print(f"| {name} | {raw:.1f} | {raw * slower:.1f} |", flush=True)
    ours = table[f"gateway, {NOTED_MS} ms, {ENDPOINT}"]
    note(f"JSON, {rate}/s to {viewers}: CPU of rosbridge ÷ ours", [theirs * slower / run.us_a_delivery for run in ours])
