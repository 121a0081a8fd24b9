"""`metaros supervisor` as a process: killed, ended, started twice, brought back."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import psutil
import pytest

from metaros.supervise.client import ask
from metaros.supervise.node_table_file import TableFile, read_rows
from metaros.supervise.program import STOPPED, running_pid
from tests.support.nodes.node_code import DEAF, SLEEP
from tests.support.processes.command_line import call_metaros, program, stop_metaros
from tests.support.processes.processes import END_S, started
from tests.support.waiting import wait_until


def put_table(directory: Path, *rows: dict[str, Any]) -> None:
    TableFile(directory / "supervisor.json").replace(read_rows(list(rows)), frozenset(), tag="")


def row(name: str, code: str = SLEEP, **values: Any) -> dict[str, Any]:
    return {"name": name, "argv": [sys.executable, "-S", "-c", code], **values}


@contextmanager
def supervisor(directory: Path) -> Iterator[subprocess.Popen[str]]:
    """One that is ready."""
    ready = directory / "ready.json"
    ready.unlink(missing_ok=True)
    argv = program("supervisor", "--state-dir", str(directory), "--status-file", str(ready))
    with started(argv, stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL) as process:
        wait_until(lambda: ready.exists() or process.poll() is not None)
        yield process


def pids(directory: Path) -> dict[str, int]:
    return {node["name"]: node["pid"] for node in ask(directory, "list")["nodes"] if node["pid"]}


def are_up(directory: Path, *names: str) -> bool:
    def up(name: str) -> bool:
        path = directory / "logs" / f"{name}.log"
        return path.exists() and b" up\n" in path.read_bytes() and name in pids(directory)

    return all(up(name) for name in names)


def wait_up(directory: Path, *names: str) -> dict[str, int]:
    wait_until(lambda: are_up(directory, *names))
    return pids(directory)


@pytest.mark.integration
@pytest.mark.skipif(sys.platform != "linux", reason="the parent-death signal is Linux's")
def test_killing_it_kills_all_its_nodes_and_it_comes_back_with_them(tmp_path: Path) -> None:
    put_table(tmp_path, row("a"), row("b", DEAF), row("c", DEAF, after=["a"]))
    with supervisor(tmp_path) as process:
        before = wait_up(tmp_path, "a", "b", "c")
        process.kill()
        process.wait(END_S)
        wait_until(lambda: not any(psutil.pid_exists(pid) for pid in before.values()))
    with supervisor(tmp_path):
        after = wait_up(tmp_path, "a", "b", "c")
        assert set(after) == {"a", "b", "c"}
        assert not set(after.values()) & set(before.values())


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGTERM")
def test_sigterm_stops_the_nodes_in_order(tmp_path: Path) -> None:
    said = tmp_path / "said"
    code = f"{SLEEP}; open({str(said)!r}, 'a').write(__import__('sys').argv[1])"
    rows = [row(name, after=after) for name, after in (("a", []), ("b", ["a"]), ("c", ["b"]))]
    for one in rows:
        one["argv"] = [sys.executable, "-S", "-c", code, one["name"]]
    put_table(tmp_path, *rows)
    done = stop_metaros(
        *("supervisor", "--state-dir", str(tmp_path)),
        when=lambda _: running_pid(tmp_path) is not None and are_up(tmp_path, "a", "b", "c"),
        by=signal.SIGTERM,
    )
    assert done.code == 0, done.err
    assert said.read_text() == "cba"
    assert not (tmp_path / STOPPED).exists()
    assert running_pid(tmp_path) is None


def test_only_one_runs_a_directory_which_has_status_and_stop(tmp_path: Path) -> None:
    put_table(tmp_path, row("a", version="1.2.0"))
    place = ("--state-dir", str(tmp_path))
    with supervisor(tmp_path) as process:
        assert running_pid(tmp_path) == process.pid
        second = call_metaros("supervisor", *place)
        assert second.code != 0
        assert f"process {process.pid}" in second.err
        assert ask(tmp_path, "list")["pid"] == process.pid
        pid = wait_up(tmp_path, "a")["a"]
        shown = call_metaros("supervisor", "status", *place).out
        assert "running" in shown
        assert str(pid) in shown
        assert "1.2.0" in shown
        shown = call_metaros("supervisor", "status", *place, "-o", "json").out
        assert json.loads(shown)[0]["nodes"][0]["pid"] == pid
        assert call_metaros("supervisor", "stop", *place).out.strip() == "stopped"
        process.wait(END_S)
    assert (tmp_path / STOPPED).exists()
    assert not psutil.pid_exists(pid)
    done = call_metaros("supervisor", "status", *place)
    assert done.code == 1
    assert "no supervisor" in done.err


def test_a_damaged_table_is_said_and_starts_nothing(tmp_path: Path) -> None:
    (tmp_path / "supervisor.json").write_text("{")
    done = call_metaros("supervisor", "--state-dir", str(tmp_path))
    assert done.code != 0
    assert "supervisor.json" in done.err


@pytest.mark.integration
@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGTERM")
def test_a_second_request_kills_who_does_not_end(tmp_path: Path) -> None:
    put_table(tmp_path, row("a", DEAF))
    with supervisor(tmp_path) as process:
        pid = wait_up(tmp_path, "a")["a"]
        os.kill(process.pid, signal.SIGTERM)
        os.kill(process.pid, signal.SIGINT)
        process.wait(END_S)
    assert not psutil.pid_exists(pid)
