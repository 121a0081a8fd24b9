"""`metaros broker` as a command: its ports, its router, its end, and what it shows."""

from __future__ import annotations

import io
import json
import signal
import socket
import subprocess
from pathlib import Path

import pytest
import zmq
from rich.console import Console

from metaros.broker import BrokerReport, Direction, TopicRow
from metaros.cli.broker import commands
from metaros.cli.broker.screen import Watcher, render, report_facts
from metaros.clock import ManualClock
from tests.metaros.cli.conftest import Run, assert_reported
from tests.support.ports import free_port
from tests.support.processes.command_line import program, stop_metaros
from tests.support.processes.processes import END_S, started
from tests.support.waiting import wait_until


def row(topic: str, direction: Direction, messages: int, **facts: int) -> TopicRow:
    counts = {"bridged": messages, "dropped": 0, "malformed": 0, **facts}
    kind = "std_msgs/msg/String"
    return TopicRow(
        topic=topic, direction=direction, type=kind, messages=messages, bytes=100 * messages, heard=True, **counts
    )


def test_it_hosts_the_router_and_bridges_until_reported_to_stop(tmp_path: Path) -> None:
    status, (xsub, xpub, port) = tmp_path / "status.json", (free_port() for _ in range(3))
    argv = program("broker", "--status-file", str(status), "--zenoh-port", str(port))
    argv += ["--xsub", str(xsub), "--xpub", f"tcp://127.0.0.1:{xpub}"]
    log = tmp_path / "log"
    with log.open("wb") as out, started(argv, stdout=out, stderr=subprocess.STDOUT) as process:
        wait_until(lambda: status.exists() or process.poll() is not None)
        assert process.poll() is None, log.read_text()
        assert json.loads(status.read_text())["xsub"] == [f"tcp://127.0.0.1:{xsub}"]
        with zmq.Context() as context, context.socket(zmq.PUB) as publisher:
            publisher.linger = 0
            publisher.connect(f"tcp://127.0.0.1:{xsub}")

            def bridged() -> bool:
                publisher.send(b'/chatter {"data": "hello"}')
                return "ZeroMQ → ROS  /chatter  std_msgs/msg/String" in log.read_text(encoding="utf-8")

            wait_until(bridged, every_s=0.05)
        process.send_signal(signal.SIGTERM)
        assert process.wait(END_S) == 0, log.read_text()
    text = log.read_text(encoding="utf-8")
    assert f"tcp/127.0.0.1:{port}, hosted here" in text
    assert text.splitlines()[-1] == "stopped"


def test_json_lines_for_machines_and_a_warning_beyond_loopback(
    zenoh_port: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(commands, "REPORT_S", 0.05)
    ports = ("--xsub", str(free_port()), "--xpub", str(free_port()), "--zenoh-port", zenoh_port)
    done = stop_metaros("broker", "-o", "json", "--host", "0.0.0.0", *ports, when=lambda out: "\n" in out)
    assert done.code == 0
    assert json.loads(done.out.splitlines()[0])["rows"] == []
    assert "ZeroMQ has no authentication" in done.err


def test_what_cannot_be_is_one_line_and_exit_code_2(run: Run) -> None:
    table = {
        ("--xsub", "udp://1.2.3.4:5"): (2, "udp://1.2.3.4:5"),
        ("--xpub", "tcp://127.0.0.1"): (2, "port"),
        ("--map", "/chatter"): (2, "TOPIC=TYPE"),
        ("--map", "/chatter=no/Such"): (2, "no/Such"),
        ("--only", "/a b"): (2, "pattern"),
    }
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        table["--xsub", str(port), "--xpub", str(free_port())] = 2, f"port {port} is in use by"
        table["--xpub", str(port), "--xsub", str(free_port())] = 2, "--xsub PORT"
        assert_reported(run, table, "broker")


def test_the_table(clock: ManualClock) -> None:
    watcher = Watcher(clock)
    first = BrokerReport(rows=(row("/in", Direction.TO_ROS, 10), row("/out", Direction.TO_ZMQ, 5)))
    watcher.look(first)
    clock.advance(2.0)
    rows = (row("/in", Direction.TO_ROS, 50, malformed=3), row("/out", Direction.TO_ZMQ, 5, dropped=7))
    report = BrokerReport(rows=rows, hub_frames=60, unreadable=4, hub_missed=9, subscriptions=("/out",))
    look = watcher.look(report)
    screen = Console(file=io.StringIO(), width=140)
    screen.print(render(look, 24))
    text = screen.file.getvalue()  # type: ignore[attr-defined]
    lines = {line.split()[0]: line for line in text.splitlines() if line.startswith("/")}
    assert "20.0" in lines["/in"]
    assert lines["/in"].split()[-1] == "3"
    assert lines["/out"].split()[-2:] == ["7", "–"]
    assert "1 ZeroMQ subscription " in text
    assert "4 without a ROS topic" in text
    assert "9 too fast" in text
    facts = report_facts(look)
    assert (facts["rows"][0]["direction"], facts["rows"][0]["rate_hz"]) == ("to_ros", 20.0)


def test_the_table_fits_the_screen_and_news_come_once(clock: ManualClock) -> None:
    watcher = Watcher(clock)
    report = BrokerReport(rows=tuple(row(f"/t{number}", Direction.TO_ROS, 1) for number in range(50)))
    screen = Console(file=io.StringIO(), width=140)
    screen.print(render(watcher.look(report), 20))
    text = screen.file.getvalue()  # type: ignore[attr-defined]
    assert text.count("\n") < 20
    assert "… and 38 more" in text
    assert len(watcher.news(report)) == 50
    assert watcher.news(report) == []
