"""A robot that sends far more than it may, as real processes: it gets later, and whole."""

from __future__ import annotations

import json
import urllib.request
from pathlib import Path
from typing import Any

import pytest

from tests.support.robots.load_robot_stack import LoadStack
from tests.support.waiting import wait_until

QUOTA = 800  # a second, where the robot makes about 2,300


@pytest.mark.integration
def test_a_robot_over_its_quota_loses_nothing_and_keeps_its_session(tmp_path: Path) -> None:
    with LoadStack(tmp_path, gateway={"robot_messages_per_s": QUOTA}) as stack:
        stack.start("gateway")
        stack.start("robot")
        stack.wait_online()
        wait_until(lambda: reported(stack)["counts"]["put_off"] >= 2)  # what waits then is drained at the quota's pace
        wait_until(lambda: stack.counters["bulk"] >= 2 * QUOTA)
        link = reported(stack)["link"]
        verdict = stack.check()
    assert verdict.good, verdict.problems
    assert (verdict.declared, verdict.rows) == (0, verdict.accepted)
    assert verdict.accepted > 2 * QUOTA
    assert link["reconnects"] == 0, "it is told to wait, not thrown out"


def reported(stack: LoadStack) -> dict[str, Any]:
    """The robot as the gateway shows it."""
    url = f"http://127.0.0.1:{stack.gateway_config.http_port}/api/v1/robots/robot"
    with urllib.request.build_opener(urllib.request.ProxyHandler({})).open(url, timeout=30) as answer:
        return dict(json.load(answer))
