"""`metaros up` for real: everything answers, two live side by side, and nothing is left behind."""

from __future__ import annotations

import json
import os
import re
import signal
import socket
import subprocess
import sys
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import httpx
import psutil
import pytest

from tests.support.ports import free_port
from tests.support.processes.command_line import call_metaros
from tests.support.processes.processes import END_S, end
from tests.support.waiting import wait_until

START_S = 200.0


class Up:
    """One `metaros up` and what it says."""

    def __init__(self, folder: Path, *arguments: str) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self.log = folder / "up.log"
        self._out = self.log.open("wb")
        self.process = subprocess.Popen(
            [sys.executable, "-m", "metaros", "up", *arguments],
            stdin=subprocess.DEVNULL,
            stdout=self._out,
            stderr=subprocess.STDOUT,
        )
        self.seen: dict[int, psutil.Process] = {}

    @property
    def text(self) -> str:
        return self.log.read_text()

    def wait_ready(self) -> None:
        # the last line of the screen: the addresses above it are read at once
        wait_until(lambda: "Ctrl-C" in self.text or self.process.poll() is not None, timeout_s=START_S, every_s=0.1)
        assert self.process.poll() is None, self.text
        self.children()

    def children(self) -> list[psutil.Process]:
        """All descendants; remembered, so that `gone` can ask for those whose parent is dead."""
        found = psutil.Process(self.process.pid).children(recursive=True)
        self.seen |= {child.pid: child for child in found}
        return found

    def gone(self) -> bool:
        return not any(child.is_running() and child.status() != psutil.STATUS_ZOMBIE for child in self.seen.values())

    def state(self) -> dict[str, Any]:
        """What `metaros status` says of it."""
        rows = json.loads(call_metaros("status", "-o", "json").out)
        (own,) = (found for found in rows if found["pid"] == self.process.pid)
        return own  # type: ignore[no-any-return]

    def get(self, path: str) -> Any:
        try:
            with urllib.request.urlopen(f"{self.state_url}{path}", timeout=120) as answer:
                return json.load(answer)
        except (urllib.error.URLError, ConnectionError, TimeoutError):
            return None

    @property
    def state_url(self) -> str:
        (line,) = (line for line in self.text.splitlines() if line.strip().startswith("Dashboard"))
        return line.split()[1]

    def online(self) -> set[str]:
        answer = self.get("/api/v1/robots") or {"robots": []}
        return {robot["id"] for robot in answer["robots"] if robot["state"] == "online"}

    def pid_of(self, name: str) -> int:
        (row,) = (row for row in self.state()["processes"] if row["name"] == name)
        return int(row["pid"])

    def stop(self, number: int = signal.SIGINT) -> None:
        self.children()
        self.process.send_signal(number)
        assert self.process.wait(END_S) == 0, self.text
        assert self.gone(), self.text

    def close(self) -> None:
        end(self.process)
        self._out.close()


@contextmanager
def running(folder: Path, *arguments: str) -> Iterator[Up]:
    """A ready instance, killed at the end if the test has not stopped it."""
    up = Up(folder, *arguments)
    try:
        up.wait_ready()
        yield up
    finally:
        up.close()


@pytest.fixture(autouse=True)
def own_places(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """State files and default data of this test only."""
    monkeypatch.setenv("METAROS_RUNTIME_DIR", str(tmp_path / "runtime"))
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "home"))
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.delenv("METAROS_ZENOH_PORT", raising=False)


def ports() -> tuple[str, ...]:
    """Explicit free ports, so that tests beside each other do not meet."""
    return ("--port", str(free_port()), "--grpc-port", str(free_port()), "--zenoh-port", str(free_port()))


def host_name(up: Up) -> str:
    """The robot that is this machine: the last one listed."""
    return str(up.state()["robots"][-1])


def test_an_explicit_port_in_use_is_an_error_that_names_the_owner(tmp_path: Path) -> None:
    with ExitStack() as stack:
        ups = []
        for option in ("--port", "--grpc-port", "--zenoh-port"):
            foreign = stack.enter_context(socket.create_server(("127.0.0.1", 0)))
            where = ("--data-dir", str(tmp_path / option / "data"))
            ups.append(Up(tmp_path / option, option, str(foreign.getsockname()[1]), *where))
            stack.callback(ups[-1].close)
        for up in ups:
            assert up.process.wait(END_S) == 2
            assert f"(pid {os.getpid()})" in up.text
            assert "Traceback" not in up.text


def test_sigterm_while_starting_leaves_nothing(tmp_path: Path) -> None:
    up = Up(tmp_path, "--robots", "1", "--data-dir", str(tmp_path / "data"), *ports())
    wait_until(lambda: (tmp_path / "data" / "logs" / "gateway.log").exists() or up.process.poll() is not None)
    up.stop(signal.SIGTERM)
    up.close()


@pytest.mark.integration
@pytest.mark.timeout(600)
def test_an_instance_survives_its_gateway_and_another_one_on_its_router_outlives_it(tmp_path: Path) -> None:
    """The first moves away from foreign programs on the default ports, and stops in order where its terminal is closed.

    kill -9 of the second leaves no process. One story, as each start costs as much as all that is asked of it.
    """
    with foreign_listeners(8080, 8081, 7447), running(tmp_path / "a", "--robots", "1") as first:
        state = first.state()
        check_moved(first, state)
        assert first.get("/readyz")["status"] == "ready"
        assert first.online() == {"sim_1", host_name(first)}
        logs = Path(state["data_dir"]) / "logs"
        assert {path.name for path in logs.iterdir()} >= {"gateway.log", "router.log", "sim.log"}
        secret = check_signs_in(first, credentials(tmp_path))
        check_survives(first)
        own = ("--port", str(free_port()), "--grpc-port", str(free_port()), "--zenoh-port", str(state["zenoh_port"]))
        with running(tmp_path / "b", "--robots", "1", "--data-dir", str(tmp_path / "data"), *own) as second:
            assert "joining it" in second.text
            assert second.online() == {"sim_2", host_name(second)}
            assert second.state()["data_dir"] == str(tmp_path / "data")
            first.stop(signal.SIGHUP)
            assert first.text.rstrip().endswith("stopped")
            assert first.state_url not in credentials(tmp_path).read_text()
            assert secret not in "".join(path.read_text() for path in logs.iterdir())
            assert list((tmp_path / "runtime").glob(f"up-{first.process.pid}.*")) == []
            wait_until(lambda: second.online() == {"sim_2", host_name(second)}, timeout_s=60)
            assert len(second.children()) >= 4
            second.process.kill()
            second.process.wait()
            wait_until(second.gone, timeout_s=60)


def check_moved(up: Up, state: dict[str, Any]) -> None:
    """It took other ports than the foreign programs have, and said so."""
    assert state["state"] == "ready"
    for name, port in (("http_port", 8080), ("grpc_port", 8081), ("zenoh_port", 7447)):
        assert state[name] not in (8080, 8081, 7447)
        assert f"port {port} is in use by" in up.text
    assert str(state["http_port"]) in up.text


def credentials(folder: Path) -> Path:
    """The keys of this user's command line."""
    return folder / "home" / ".metaros" / "credentials"


def check_signs_in(up: Up, keys: Path) -> str:
    """The printed link signs in once, and the command line has a key; the link's token."""
    link = re.search(r"Sign in +(http://127\.0\.0\.1:\d+)/signin#([0-9a-f]{64}) ", up.text)
    assert link is not None, up.text
    assert link[1] == up.state_url

    def follow() -> httpx.Response:
        return httpx.post(f"{link[1]}/api/v1/auth/link", json={"token": link[2]}, trust_env=False, timeout=60)

    first, second = follow(), follow()
    assert (first.status_code, first.json()["name"], first.json()["role"]) == (200, "admin", "admin")
    assert (second.status_code, second.json()["code"]) == (401, "bad_credentials")
    listed = subprocess.run(
        [sys.executable, "-m", "metaros", "user", "list", "-o", "json"], capture_output=True, text=True, timeout=120
    )
    assert [user["name"] for user in json.loads(listed.stdout)] == ["admin"], listed.stderr
    assert keys.stat().st_mode & 0o077 == 0
    return link[2]


def check_survives(up: Up) -> None:
    """kill -9 of its gateway: another one comes, and everybody is back there."""
    everyone, first = up.online(), up.pid_of("gateway")
    os.kill(first, signal.SIGKILL)
    wait_until(lambda: "gateway restarted" in up.text)
    wait_until(lambda: (up.get("/readyz") or {}).get("status") == "ready", timeout_s=60, every_s=0.05)
    wait_until(lambda: up.online() == everyone, timeout_s=60, every_s=0.05)
    assert "gateway killed by SIGKILL" in up.text
    assert up.pid_of("gateway") != first


@contextmanager
def foreign_listeners(*wanted: int) -> Iterator[None]:
    """Listen on each of these ports; one that is in use already serves as well."""
    held = []
    for port in wanted:
        listener = socket.socket()
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listener.bind(("127.0.0.1", port))
            listener.listen(8)
        except OSError:
            listener.close()
            continue
        held.append(listener)
    try:
        yield
    finally:
        for listener in held:
            listener.close()
