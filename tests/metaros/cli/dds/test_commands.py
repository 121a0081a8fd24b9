"""`metaros dds` as a command: its router, its end, and what it shows."""

from __future__ import annotations

import io
import json
import signal
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest
from cyclonedds.core import Policy, Qos
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.topic import Topic
from rich.console import Console

from metaros.cli.dds.screen import Watcher, render, report_facts
from metaros.clock import ManualClock
from metaros.dds import DdsReport, RouteRow
from metaros.dds.report import Direction
from tests.metaros.cli.conftest import Run
from tests.metaros.dds.dds_types import String
from tests.support.ports import free_port
from tests.support.processes.command_line import call_metaros, program
from tests.support.processes.processes import END_S, started
from tests.support.servers.dds import dds_config, dds_domain
from tests.support.waiting import wait_until


def row(name: str, bridged: int, **facts: int) -> RouteRow:
    counts = {"dropped": 0, "failed": 0, **facts}
    return RouteRow(
        name=name,
        direction=Direction.TO_ROS,
        type="std_msgs/msg/String",
        bridged=bridged,
        bytes=100 * bridged,
        **counts,
    )


@pytest.mark.integration
def test_a_robot_on_dds_is_bridged_until_the_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CYCLONEDDS_URI", dds_config())
    status, port = tmp_path / "status.json", free_port()
    argv = program("dds", "--status-file", str(status), "--zenoh-port", str(port), "--dds-domain", str(dds_domain()))
    log = tmp_path / "log"
    with log.open("wb") as out, started(argv, stdout=out, stderr=subprocess.STDOUT) as process:
        wait_until(lambda: status.exists() or process.poll() is not None)
        domain, participant = Domain(dds_domain(), dds_config()), DomainParticipant(dds_domain())
        writer = DataWriter(
            participant, Topic(participant, "rt/chatter", String), qos=Qos(Policy.Reliability.Reliable(100_000_000))
        )
        wait_until(lambda: "DDS → ROS  /chatter  std_msgs/msg/String" in log.read_text(encoding="utf-8"))
        listed = call_metaros("topic", "list", "-t", "--zenoh-port", str(port), "--spin-time", "60")
        assert "/chatter" in listed.out
        del writer, participant, domain
        process.send_signal(signal.SIGTERM)
        assert process.wait(END_S) == 0, log.read_text()
    text = log.read_text(encoding="utf-8")
    assert f"tcp/127.0.0.1:{port}, hosted here" in text
    assert text.splitlines()[-1] == "stopped"


def test_the_table_the_news_and_the_facts() -> None:
    clock = ManualClock()
    watcher = Watcher(clock)
    problems = ("/x: no such type",)
    first = DdsReport(rows=(row("/scan", 10), row("/tf", 0, failed=2)), participants=1, problems=problems)
    watcher.look(first)
    clock.advance(1.0)
    look = watcher.look(replace(first, rows=(row("/scan", 30), *first.rows[1:])))
    assert report_facts(look)["rows"][0] | {"rate_hz": 0} == {
        "name": "/scan",
        "direction": "to_ros",
        "type": "std_msgs/msg/String",
        "bridged": 30,
        "bytes": 3000,
        "dropped": 0,
        "failed": 0,
        "rate_hz": 0,
        "bytes_per_s": 2000.0,
    }
    assert json.dumps(report_facts(look))
    out = io.StringIO()
    Console(file=out, width=120, color_system=None).print(render(look, 40))
    text = out.getvalue()
    assert "20.0" in text
    assert "not bridged: /x: no such type" in text
    assert "1 DDS participant   2 routes" in text
    assert watcher.news(first) == [
        "DDS → ROS  /scan  std_msgs/msg/String",
        "DDS → ROS  /tf  std_msgs/msg/String",
        "not bridged: /x: no such type",
    ]
    assert watcher.news(first) == []


def test_a_wrong_pattern_is_one_line_and_exit_code_2(run: Run) -> None:
    done = run("dds", "--only", "/a b")
    assert (done.code, "pattern" in done.err) == (2, True)


def test_a_domain_that_cannot_be_joined_is_an_error_in_words(
    zenoh_port: str, monkeypatch: pytest.MonkeyPatch, run: Run
) -> None:
    monkeypatch.setenv("CYCLONEDDS_URI", "<CycloneDDS><NoSuchThing/></CycloneDDS>")
    done = run("dds", "--dds-domain", "9", "--zenoh-port", zenoh_port)
    assert (done.code, "cannot join the DDS domain 9" in done.err, "CYCLONEDDS_URI" in done.err) == (2, True, True)
