"""Accidents with real processes: a wiped disk, a copied one, a calendar that is ten years off. Nothing silent.

`docs/topics/delivery.md` says what is to happen in each case.
"""

from __future__ import annotations

import os
import shutil
import signal
import sqlite3
from collections.abc import Iterator
from pathlib import Path

import pytest

from metaros.interfaces.std_msgs.msg import UInt64
from metaros.node import Context, Node
from tests.faults.campaigns import skip_without_faketime
from tests.support.processes.stack import Program, Stack
from tests.support.robots.checker import check
from tests.support.robots.load_robot_stack import LoadStack
from tests.support.waiting import wait_until

pytestmark = pytest.mark.integration

TEN_YEARS_S = 315_532_800


def drained(stack: LoadStack) -> None:
    """The robot ends well: everything it accepted is stored."""
    stack.signal("robot", signal.SIGTERM)
    stack.processes["robot"].join(60)
    assert stack.processes["robot"].exitcode == 0, stack.tail("robot")
    stack.kill("robot")


def accepted_some(stack: LoadStack, samples: int = 200) -> None:
    """The robot has handed over that many, and synced since."""
    wait_until(lambda: stack.counters["bulk"] >= samples, timeout_s=60)
    since = stack.counters["accept_ns"]
    wait_until(lambda: stack.counters["accept_ns"] > since, timeout_s=60)


def test_a_robot_with_a_wiped_disk_begins_a_new_epoch_and_what_was_stored_stays(tmp_path: Path) -> None:
    with LoadStack(tmp_path) as stack:
        stack.start("gateway")
        stack.start("robot")
        stack.wait_online()
        accepted_some(stack)
        drained(stack)
        shutil.rmtree(stack.robot_config.state_dir)

        stack.start("robot")
        stack.wait_online()
        accepted_some(stack)
        verdict = stack.check()

    assert verdict.problems == []
    assert verdict.epochs == 2
    assert verdict.declared == 0
    assert verdict.accepted > 400


def test_a_copy_of_a_running_robot_is_found_out_and_neither_of_them_loses_anything(tmp_path: Path) -> None:
    with LoadStack(tmp_path / "first") as first:
        first.start("gateway")
        first.start("robot")
        first.wait_online()
        accepted_some(first)
        first.signal("robot", signal.SIGSTOP)
        shutil.copytree(first.robot_config.state_dir, tmp_path / "second" / "state")
        first.signal("robot", signal.SIGCONT)
        twin = {"gateway": first.robot_config.gateway, "life": 99}
        with LoadStack(tmp_path / "second", robot=twin) as second:
            second.start("robot")
            accepted_some(second)
            accepted_some(first, 1000)
            for stack in (second, first):  # each in turn has the link to itself at the end
                drained(stack)
        first.signal("gateway", signal.SIGTERM)
        first.processes["gateway"].join(60)
        log = (tmp_path / "first" / "robot.log").read_text() + (tmp_path / "second" / "robot.log").read_text()
        verdict = check(first.stored(), tmp_path / "first", lives=1, copies=[tmp_path / "second"])

    assert (verdict.lost, verdict.wrong) == (0, 0), verdict.problems[:10]
    assert verdict.epochs >= 2
    assert "another copy of this outbox" in log


@pytest.fixture
def robot(tmp_path: Path) -> Iterator[Stack]:
    """A router, a gateway, and a topic table of one bulk topic."""
    (tmp_path / "agent.toml").write_text('default_topics = false\n[[topics]]\nmatch = "**/count"\nclass = "bulk"\n')
    with Stack(tmp_path) as stack:
        stack.router()
        stack.gateway()
        yield stack


def agent_at(robot: Stack, offset_s: int, monkeypatch: pytest.MonkeyPatch) -> Program:
    """The real agent, with its calendar so far off."""
    if offset_s:
        monkeypatch.setenv("LD_PRELOAD", skip_without_faketime())
        monkeypatch.setenv("FAKETIME", f"{offset_s:+d}s")
        monkeypatch.setenv("DONT_FAKE_MONOTONIC", "1")
        monkeypatch.setenv("FAKETIME_FORCE_MONOTONIC_FIX", "0")  # else threads that wait with a time-out spin
    try:
        return robot.agent("robot", "--config", str(robot.folder / "agent.toml"))
    finally:
        for name in ("LD_PRELOAD", "FAKETIME", "DONT_FAKE_MONOTONIC", "FAKETIME_FORCE_MONOTONIC_FIX"):
            monkeypatch.delenv(name, raising=False)


def stored_counts(robot: Stack) -> list[int]:
    """The counts that the store has; in order within their stream, and in one epoch without a gap."""
    connection = sqlite3.connect(f"file:{robot.folder / 'data' / 'gateway.sqlite'}?mode=ro", uri=True)
    try:
        rows = connection.execute("SELECT epoch, stream_id, payload FROM sample_batches ORDER BY first_seq").fetchall()
        assert connection.execute("SELECT count(*) FROM gaps").fetchone() == (0,)
    finally:
        connection.close()
    assert len({epoch for epoch, _, _ in rows}) <= 1, "the epoch changed"
    streams: dict[int, list[int]] = {}
    for _, stream, data in rows:
        counts = [int.from_bytes(data[at + 4 : at + 12], "little") for at in range(0, len(data), 12)]
        streams.setdefault(stream, []).extend(counts)
    assert all(counts == sorted(counts) for counts in streams.values()), "out of order"
    return [count for counts in streams.values() for count in counts]


def test_a_calendar_ten_years_off_changes_no_order_and_loses_nothing(
    robot: Stack, monkeypatch: pytest.MonkeyPatch
) -> None:
    count, published = 0, {}
    endpoint = f"tcp/127.0.0.1:{robot.zenoh_port}"
    with (
        Context(connect=[endpoint], shared_memory="off") as context,
        Node("counter", namespace="/robot", context=context) as node,
    ):
        publisher = node.create_publisher(UInt64, "count", 100)
        for offset_s in (0, TEN_YEARS_S, -TEN_YEARS_S):
            agent = agent_at(robot, offset_s, monkeypatch)
            wait_until(lambda: robot.online() == {"robot"}, timeout_s=60)
            first = count + 1

            def seen(since: int = first) -> bool:
                nonlocal count
                for _ in range(5):
                    count += 1
                    publisher.publish(UInt64(data=count))
                return sum(number >= since for number in stored_counts(robot)) >= 100

            wait_until(seen, timeout_s=60, every_s=0.05)
            last = count
            wait_until(lambda last=last: last in stored_counts(robot), timeout_s=60)
            published[offset_s, first] = last
            os.kill(agent.process.pid, signal.SIGKILL)
            agent.process.wait(60)
    found = sorted(stored_counts(robot))

    assert found == sorted(set(found)), "twice"
    for (_, first), last in published.items():
        of_this_life = [number for number in found if first <= number <= last]
        assert of_this_life == list(range(of_this_life[0], last + 1)), "a hole after the tap had begun"
