"""`metaros agent status`: a running agent answers, a stopped one's directory is read, and nobody is a clear word."""

from __future__ import annotations

import json
import signal
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from edge_agent.cli.agent import register
from edge_agent.cli.status import box_line, lines, rows_of, twin_line
from edge_agent.state.state_dir import locked
from tests.edge_agent.status.test_report import filled
from tests.edge_agent.test_main import start
from tests.support.ports import free_port
from tests.support.processes.processes import END_S
from tests.support.waiting import wait_until

CLASS = {
    "name": "bulk",
    "fresh_bytes": 0,
    "backfill_bytes": 2_000_000,
    "samples": 1234,
    "lost": 5,
    "disk_bytes": 3_000_000,
    "quota_bytes": 10_000_000,
    "oldest_ns": None,
}


@pytest.fixture(autouse=True)
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The user's directory, where agents keep their state."""
    monkeypatch.setattr(Path, "home", staticmethod(lambda: tmp_path / "home"))
    return tmp_path / "home"


def status(*options: str, port: int | None = None) -> tuple[int, str]:
    app = typer.Typer()
    app.callback()(lambda: None)
    register(app)
    done = CliRunner().invoke(app, ["agent", "status", "--zenoh-port", str(port or free_port()), *options])
    assert done.exception is None or isinstance(done.exception, SystemExit), done.exception
    return done.exit_code, done.output


def test_nobody_is_exit_code_1() -> None:
    code, output = status()
    assert code == 1
    assert "no agent runs here" in output
    code, output = status("-o", "json", "--name", "r1")
    assert (code, json.loads(output)) == (1, [])


def test_what_a_stopped_agent_left_is_shown(home: Path) -> None:
    filled(home / ".metaros" / "agent" / "r1")
    code, output = status("--name", "r1")
    assert code == 0
    assert "r1  does not run; what it left:" in output
    assert "no limit" in output
    code, output = status("-o", "json")
    assert [row["samples"] for row in json.loads(output)[0]["classes"]] == [3, 0, 5]


def test_recordings_and_the_black_box_that_a_stopped_agent_left_are_shown(home: Path) -> None:
    directory = home / ".metaros" / "agent" / "r1"
    for name in ("outbox", "black_box", "recordings"):
        (directory / name).mkdir(parents=True)
    code, output = status("--name", "r1")
    assert (code, "holds nothing" in output) == (0, True)
    (directory / "black_box" / "000000000001.mcap").write_bytes(bytes(3000))
    (directory / "recordings" / "01HZZZZZZZZZZZZZZZZZZZZZ01.mcap").write_bytes(bytes(2000))
    code, output = status("--name", "r1")
    assert "1 wait for the gateway, 2 kB" in output
    assert "3 kB, until " in output
    (report,) = json.loads(status("-o", "json")[1])
    assert (report["black_box"]["size_bytes"], report["recordings"]) == (3000, {"count": 1, "size_bytes": 2000})


def test_a_black_box_in_words() -> None:
    box = {"from_ns": 0, "to_ns": 0, "size_bytes": 0, "quota_bytes": 0, "lost": 0}
    assert box_line(box, running=True) == "off"
    assert box_line({**box, "quota_bytes": 1000}, running=True) == "empty"
    full = {**box, "from_ns": 1, "to_ns": 300_000_000_001, "size_bytes": 2_000_000, "quota_bytes": 4_000_000, "lost": 7}
    assert box_line(full, running=True) == "the last 5 min 0 s, 2 MB of 4 MB, 7 lost"


def test_an_agent_out_of_sight_is_known_by_its_lock(tmp_path: Path) -> None:
    directory = tmp_path / "elsewhere"
    filled(directory)
    with locked(directory):
        code, output = status("--state-dir", str(directory))
        assert (code, "runs, but does not answer on this router" in output) == (0, True)
    code, output = status("--state-dir", str(directory))
    assert (code, "does not run" in output) == (0, True)


def test_a_running_agent_answers(zenoh_router: str, tmp_path: Path) -> None:
    ready, state, port = tmp_path / "agent.json", tmp_path / "state", int(zenoh_router.rpartition(":")[2])
    options = ("--name", "r1", "--gateway", f"127.0.0.1:{free_port()}", "--zenoh-port", str(port))
    with start(*options, "--status-file", str(ready), "--state-dir", str(state)) as agent:
        wait_until(lambda: ready.exists() or agent.poll() is not None, timeout_s=60)
        found = []
        wait_until(lambda: found.append(status("-o", "json", port=port)) or found[-1][0] == 0, timeout_s=60)
        (report,) = json.loads(found[-1][1])
        assert (report["name"], report["pid"], report["linked"]) == ("r1", agent.pid, False)
        assert [row["name"] for row in report["classes"]] == ["event", "metric", "bulk", "live"]
        assert Path(report["directory"]) == state
        code, output = status(port=port)
        assert (code, "r1  no link: tries" in output) == (0, True)
        assert f"pid {agent.pid}" in output
        code, output = status("--name", "other", port=port)
        assert code == 1
        agent.send_signal(signal.SIGTERM)
        _, errors = agent.communicate(timeout=END_S)
        assert (agent.returncode, "Traceback" in errors, ready.exists()) == (0, False, False), errors
    code, output = status("--state-dir", str(state), port=port)
    assert (code, "does not run" in output) == (0, True)


@pytest.mark.parametrize(
    "answer",
    [
        b"",
        b"{",
        b"[]",
        b"3",
        b"null",
        b'{"name": "x"}',
        b'{"name": "x", "directory": "/", "classes": 3}',
        b'{"name": "x", "directory": "/", "classes": [{"name": "bulk"}]}',
        json.dumps({"name": "x", "directory": "/", "classes": [{**CLASS, "samples": "many"}]}).encode(),
        b'"' + b"x" * (2 << 20) + b'"',
    ],
)
def test_a_peers_rubbish_is_no_report(answer: bytes) -> None:
    assert list(rows_of([answer])) == []


def test_a_peers_report_is_cleaned() -> None:
    said = dict.fromkeys(("name", "namespace", "version", "transport", "gateway", "store_id"), "a\x1b[2Jb\n")
    said |= {"directory": "x" * 9999, "pid": 1, "reconnects": 2, "disk_free_bytes": 3, "linked": "yes", "more": 1}
    said |= {"sent_bytes_per_s": 4, "budget_bytes_per_s": None, "epochs": ["e"], "classes": [CLASS]}
    (report,) = rows_of([json.dumps(said).encode()])
    assert (report["name"], len(report["directory"]), report["linked"]) == ("a?[2Jb?", 256, False)
    assert "more" not in report


def test_a_class_in_words() -> None:
    assert lines([CLASS]) == [("bulk", "–", "2 MB", "1,234", "–", "3 MB", "10 MB", "30%", "5")]


def test_a_twin_in_words() -> None:
    twin = {"revision": 0, "applied": 0, "state": "applied", "code": "", "message": ""}
    assert twin_line({}) == twin_line(twin) == "none: the robot's own settings"
    assert twin_line({**twin, "revision": 3, "applied": 3}) == "revision 3"
    assert twin_line({**twin, "revision": 3, "applied": 3, "state": "on trial"}).startswith("revision 3, on trial")
    undone = {**twin, "revision": 3, "applied": 2, "state": "reverted", "message": "nobody\x1b[2J confirmed it"}
    assert twin_line(undone) == "revision 2; revision 3 was reverted: nobody?[2J confirmed it"
    assert twin_line({**undone, "applied": 0}).startswith("the robot's own settings; revision 3 was reverted")
