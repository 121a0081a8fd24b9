"""`metaros sim`: one process, N robots, one 50 Hz loop on the main thread.

The loop spins the executor until the next step is due, steps the fleet by a fixed time, and publishes. A machine that
falls behind by more than `_CATCH_UP_S` loses that time, rather than replaying it at once.
"""

from __future__ import annotations

import json
import os
import threading
from collections.abc import Sequence
from pathlib import Path

from metaros.clock import Clock
from metaros.errors import ConfigError
from metaros.executor import SingleThreadedExecutor
from metaros.node import Context
from metaros.sim.camera import make_renderer
from metaros.sim.faults import parse_schedule
from metaros.sim.fleet import STEP_S, Fleet
from metaros.sim.node import RobotNode

__all__ = ["run_sim"]

_CATCH_UP_S = 0.2


def run_sim(
    *,
    robots: int = 3,
    first: int = 1,
    seed: int = 1,
    context: Context,
    faults: Sequence[str] = (),
    resume_after_s: float = 10.0,
    camera: bool = True,
    status_file: Path | None = None,
    stop: threading.Event | None = None,
) -> None:
    """Drive robots `sim_<first>` … until `stop` is set; `faults` are texts like `sim_2:stuck_wheel@30`.

    Blocks. Raises ConfigError for a bad count, fault or setting before anything is started. `status_file` is written
    atomically when every publisher is declared. Without OpenCV there is no camera topic, which is logged once.
    """
    if first < 0:
        raise ConfigError(f"first must be 0 or more, not {first}")
    fleet = Fleet(
        robots=robots,
        first=first,
        seed=seed,
        faults=[parse_schedule(text) for text in faults],
        resume_after_s=resume_after_s,
    )
    renderer = make_renderer() if camera else None
    executor = SingleThreadedExecutor()
    nodes: list[RobotNode] = []
    try:
        for robot in fleet.robots:
            nodes.append(RobotNode(fleet, robot, context=context, renderer=renderer))
            executor.add_node(nodes[-1].node)
        if camera and renderer is None:
            nodes[0].node.get_logger().warn("no camera: OpenCV is missing (pip install 'metaros[drivers]')")
        if status_file is not None:
            _write_status(status_file, [robot.name for robot in fleet.robots])
        _loop(fleet, nodes, executor, clock=context.clock, stop=stop or threading.Event())
    finally:
        executor.shutdown()
        for node in nodes:
            node.close()


def _loop(
    fleet: Fleet, nodes: list[RobotNode], executor: SingleThreadedExecutor, *, clock: Clock, stop: threading.Event
) -> None:
    next_s = clock.monotonic_s()
    while not stop.is_set():
        now_s = clock.monotonic_s()
        if now_s < next_s:
            executor.spin_once(timeout_s=next_s - now_s)
            continue
        next_s = max(next_s + STEP_S, now_s - _CATCH_UP_S)
        executor.spin_once(timeout_s=0.0)  # a command that is waiting counts before this step
        tick = fleet.tick
        fleet.step(now_s=clock.monotonic_s())
        stamp_ns = clock.wall_ns()
        for node in nodes:
            node.publish(tick, stamp_ns=stamp_ns)


def _write_status(path: Path, names: list[str]) -> None:
    """Say that all robots are there, in one rename."""
    fresh = path.with_name(f".{path.name}.{os.getpid()}")
    fresh.write_text(json.dumps({"pid": os.getpid(), "ready": True, "robots": names}) + "\n")
    os.replace(fresh, path)
