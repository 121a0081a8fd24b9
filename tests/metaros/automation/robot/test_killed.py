"""kill -9 in the middle of the work: what the disk has is done by the next life, at most what was at hand twice."""

from __future__ import annotations

import os
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from metaros.automation.robot.backlog import Backlog
from metaros.interfaces.std_msgs.msg import String
from tests.edge_agent.conftest import Robot
from tests.support.functions.robot_function import ReceivedResults, write_function
from tests.support.waiting import wait_until_async

COUNT = 100
KILLS = 2
SLOW = """
import time
def handler(event, context):
    time.sleep(0.01)
    return event["detail"]["message"]["data"]
"""

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="kill -9 is POSIX")


@contextmanager
def program(package: Path, state: Path, router: str) -> Iterator[subprocess.Popen[bytes]]:
    """The real program; killed at the end, if it still runs."""
    argv = [sys.executable, "-m", "metaros.robot_functions", "--package", str(package), "--state", str(state)]
    environ = {**os.environ, "METAROS_ZENOH_PORT": router.rpartition(":")[2], "METAROS_ROBOT": "sim_1"}
    process = subprocess.Popen([*argv, "--namespace", "/sim_1", "--level", "L1"], env=environ)
    try:
        yield process
    finally:
        process.kill()
        process.wait(60)


def under_way(state: Path) -> tuple[int, int]:
    """How many events are done, and how many were at hand when the program died."""
    backlog = Backlog(state / "backlog.sqlite3")
    try:
        counts = backlog.counts()
        return counts.waiting + counts.under_way, counts.under_way
    finally:
        backlog.close()


@pytest.mark.integration
async def test_no_event_is_lost_and_only_what_was_at_hand_is_done_twice(
    robot: Robot, zenoh_router: str, tmp_path: Path
) -> None:
    package = write_function(tmp_path / "slow", SLOW, concurrency=2, retry={"attempts": 20})
    state = tmp_path / "state"
    received, words = ReceivedResults.on(robot.node), robot.node.create_publisher(String, "word", 1000)
    at_hand = 0
    for life in range(KILLS):
        with program(package, state, zenoh_router) as process:
            await wait_until_async(lambda: robot.node.graph.endpoints("/sim_1/word", "MS"))
            if life == 0:
                for number in range(COUNT):
                    words.publish(String(data=str(number)))
                await wait_until_async(lambda: len(received.results) + under_way(state)[0] >= COUNT)
            before = len(received.results)
            await wait_until_async(lambda before=before: len(received.results) >= before + 10)
            process.kill()
            process.wait(60)
        at_hand += under_way(state)[1]
        await wait_until_async(lambda: not robot.node.graph.endpoints("/sim_1/word", "MS"))
    with program(package, state, zenoh_router):
        await wait_until_async(lambda: len({result["event"] for result in received.results}) == COUNT)
        await wait_until_async(lambda: under_way(state) == (0, 0))
    done = Counter(result["event"] for result in received.results if result["status"] == "ok")
    assert len(done) == COUNT
    assert {result["payload"] for result in received.results} == {str(number) for number in range(COUNT)}
    losses = {result["event"]: result["losses"] for result in received.results}
    assert sum(losses.values()) == at_hand
    assert {result["attempt"] for result in received.results} == {1}
