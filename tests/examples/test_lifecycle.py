"""The adaptive example beside a simulated robot whose lidar drops to 2 Hz and comes back."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

import pytest

import metaros
from metaros.interfaces.diagnostic_msgs.msg import DiagnosticArray
from metaros.interfaces.std_msgs.msg import Float64, String
from metaros.sim import run_sim
from tests.examples.test_examples import running
from tests.support.waiting import wait_until


@pytest.mark.integration
def test_a_slow_lidar_degrades_the_consumer_which_recovers_by_itself(zenoh_router: str, tmp_path: Path) -> None:
    log, stop = tmp_path / "log", threading.Event()
    speeds: list[float] = []
    reports: list[Any] = []
    context = metaros.Context(domain_id=0, connect=zenoh_router)
    options: dict[str, Any] = {"robots": 1, "camera": False, "context": context, "stop": stop}
    robot = threading.Thread(target=run_sim, kwargs=options)
    robot.start()
    try:
        with (
            running(["examples/lifecycle.py"], zenoh_router.rsplit(":", 1)[1], log),
            metaros.Context(domain_id=0, connect=zenoh_router) as other,
            metaros.Node("judge", context=other) as judge,
        ):
            faults = judge.create_publisher(String, "/sim_1/base/fault")
            judge.create_subscription(Float64, "/guard/max_speed", lambda message: speeds.append(message.data))
            judge.create_subscription(DiagnosticArray, "/guard/health", reports.append, metaros.qos_transient_local)
            executor = metaros.SingleThreadedExecutor()
            executor.add_node(judge)

            def healthy() -> bool:
                executor.spin_once(0.05)
                return len(speeds) > 20 and bool(reports) and reports[-1].status[0].message == "healthy"

            def degraded() -> bool:
                executor.spin_once(0.05)
                return "degraded: lidar: /sim_1/scan comes at 2" in reports[-1].status[0].message

            wait_until(healthy, timeout_s=60)
            faults.publish(String(data="lidar_slow"))
            wait_until(degraded, timeout_s=60)
            speeds.clear()
            wait_until(lambda: executor.spin_once(0.05) and speeds, timeout_s=60)
            assert speeds[-1] <= 0.2
            faults.publish(String(data="clear"))
            wait_until(healthy, timeout_s=60)
            executor.shutdown()
    finally:
        stop.set()
        robot.join()
        context.close()
    said = log.read_text()
    assert said.count("degraded (lidar): /sim_1/scan comes at") == 1
    assert said.count("recovered (lidar): /sim_1/scan comes at") == 1
