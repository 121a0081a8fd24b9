"""The real simulator, agents and gateway: what history gives back is what the nodes published, byte for byte."""

from __future__ import annotations

import json
from collections import defaultdict
from functools import partial
from pathlib import Path

import pytest
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from tests.support.processes.command_line import run_metaros
from tests.support.processes.stack import Stack
from tests.support.waiting import wait_until

ROBOTS = ("sim_1", "sim_2")
SPAN_S = 4
Samples = dict[str, dict[int, bytes]]  # by topic: payload by the source's stamp


def published(folder: Path) -> Samples:
    """What the recorder heard on the robots' side."""
    found: Samples = defaultdict(dict)
    for path in folder.glob("*.mcap"):
        with path.open("rb") as file:
            for _schema, channel, message in make_reader(file, validate_crcs=True).iter_messages():
                found[channel.topic][message.publish_time] = message.data
    return found


@pytest.mark.integration
def test_robots_come_back_as_they_were_published(shared_gateway: Stack, tmp_path: Path) -> None:
    with shared_gateway.beside(tmp_path) as stack:
        stack.router()
        bag = tmp_path / "bag"
        agents = [partial(stack.agent, f"kept_{robot}", namespace=f"/{robot}") for robot in ROBOTS]
        stack.at_once(lambda: stack.sim(robots=len(ROBOTS)), *agents)
        wait_until(lambda: stack.online() >= {f"kept_{robot}" for robot in ROBOTS}, timeout_s=60)
        recorder = stack.start(
            "recorder", "bag", "record", "--all", "--target", str(bag), "--duration", str(SPAN_S), ready=False
        )
        wait_until(lambda: recorder.process.poll() is not None, timeout_s=SPAN_S + 120)
        assert recorder.process.returncode == 0, recorder.output
        path = tmp_path / "export.mcap"
        options = [option for robot in ROBOTS for option in ("--robot", f"kept_{robot}")]
        printed = run_metaros("history", "export", str(path), *options, "--start", "-10m", "--gateway", stack.url)
        assert str(path) in printed
        check(path, published(bag))
        info = json.loads(run_metaros("bag", "info", str(path), "-o", "json"))
        assert info["accounted"]
        messages = run_metaros(
            "history",
            "messages",
            "kept_sim_2",
            "--topics",
            "odom",
            "--start",
            "-10m",
            "-n",
            "5",
            "-o",
            "json",
            "--gateway",
            stack.url,
        )
        assert [json.loads(line)["topic"] for line in messages.splitlines()] == ["/sim_2/odom"] * 5


def check(path: Path, heard: Samples) -> None:
    """Every exported message of the recorded time is one that was published, and no topic is missing."""
    kept: dict[str, int] = defaultdict(int)
    with AnyReader([path]) as reader:
        for connection, stamp_ns, data in reader.messages():
            if stamp_ns in heard[connection.topic]:
                assert heard[connection.topic][stamp_ns] == bytes(data)
                kept[connection.topic] += 1
            assert connection.topic.split("/")[1] in ROBOTS
    for robot in ROBOTS:
        for topic, least in (
            ("odom", SPAN_S),
            ("scan", SPAN_S // 2),
            ("imu", SPAN_S // 2),
            ("battery_state", SPAN_S // 2),
        ):
            assert kept[f"/{robot}/{topic}"] >= least, dict(kept)
