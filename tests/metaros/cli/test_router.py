"""`metaros router` as a process."""

from __future__ import annotations

import contextlib
import json
import signal
import socket
import subprocess
import sys
from contextlib import AbstractContextManager
from pathlib import Path

import pytest
import zenoh

from metaros.errors import ConfigError
from metaros.wire import WireSession, open_router, probe
from metaros.wire.router import other_routers
from tests.support.ports import free_port
from tests.support.processes import END_S, started
from tests.support.waiting import wait_until


def start(*arguments: str) -> AbstractContextManager[subprocess.Popen[str]]:
    """It, in the background."""
    return started([sys.executable, "-m", "metaros", "router", *arguments])


def test_it_hosts_until_told_to_stop(free_port: int, tmp_path: Path) -> None:
    status = tmp_path / "deep" / "router.json"
    with start("--port", str(free_port), "--status-file", str(status)) as router:
        wait_until(status.exists, timeout_s=60)
        facts = json.loads(status.read_text())
        assert (facts["pid"], facts["ready"], facts["zenoh_port"]) == (router.pid, True, free_port)
        assert probe(free_port) == "zenoh"
        router.send_signal(signal.SIGTERM)
        out, err = router.communicate(timeout=END_S)
        assert router.returncode == 0
        assert out.splitlines()[-1] == "stopped"
        assert err == ""


def test_where_one_runs_there_is_nothing_to_do(zenoh_router: str) -> None:
    port = zenoh_router.rsplit(":", 1)[1]
    with start("--port", port) as router:
        out, _ = router.communicate(timeout=END_S)
        assert router.returncode == 0
        assert "runs already" in out


def test_a_foreign_program_on_the_port_is_named() -> None:
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        listener.listen(8)
        port = listener.getsockname()[1]
        with start("--port", str(port)) as router:
            _, err = router.communicate(timeout=END_S)
            assert router.returncode == 2
            assert f"port {port} is in use by" in err
            assert "--port PORT" in err


def test_the_understudy_takes_over(free_port: int, tmp_path: Path) -> None:
    status = tmp_path / "standby.json"
    first = open_router(free_port)
    with start("--port", str(free_port), "--standby", "--status-file", str(status)) as router:
        assert router.stdout is not None
        assert "waiting" in router.stdout.readline()
        assert not status.exists()
        first.close()
        wait_until(status.exists, timeout_s=60)
        assert probe(free_port) == "zenoh"
        router.send_signal(signal.SIGINT)
        router.communicate(timeout=END_S)
        assert router.returncode == 0


def test_a_protected_router_says_what_sessions_need_and_lets_nobody_else_in(free_port: int, tmp_path: Path) -> None:
    status, folder = tmp_path / "router.json", tmp_path / "zenoh"
    protected = ("--zenoh-profile", "protected", "--zenoh-credentials", str(folder))
    with start("--port", str(free_port), *protected, "--status-file", str(status)) as router:
        wait_until(lambda: status.exists() or router.poll() is not None)
        assert probe(free_port) == "foreign"  # no password, no session
        environ = {"ZENOH_SESSION_CONFIG_URI": str(folder / "node.json5")}
        session = WireSession(environ=environ)
        assert session.connected()
        session.close()
        router.send_signal(signal.SIGTERM)
        out, _ = router.communicate(timeout=END_S)
    assert f"ZENOH_SESSION_CONFIG_URI={folder}/node.json5" in out


def test_an_open_router_is_not_taken_for_a_protected_one(zenoh_router: str, tmp_path: Path) -> None:
    port = zenoh_router.rsplit(":", 1)[1]
    protected = ("--zenoh-profile", "protected", "--zenoh-credentials", str(tmp_path))
    with start("--port", port, *protected) as router:
        _, err = router.communicate(timeout=END_S)
        assert router.returncode == 2
        assert "an open Zenoh router" in err


def test_routers_that_name_each_other_are_one_network(tmp_path: Path) -> None:
    ports = [free_port(), free_port()]
    group = [option for port in ports for option in ("--connect", f"tcp/127.0.0.1:{port}")]
    status = [tmp_path / f"{port}.json" for port in ports]
    with contextlib.ExitStack() as stack:
        for port, file in zip(ports, status, strict=True):  # each is told of both
            stack.enter_context(start("--port", str(port), *group, "--status-file", str(file)))
        wait_until(lambda: all(file.exists() for file in status), timeout_s=60)
        near, far = (stack.enter_context(client(port)) for port in ports)
        heard: list[str] = []
        near.declare_subscriber("greeting", lambda sample: heard.append(sample.payload.to_string()))

        def greeted() -> bool:  # again and again: the routers may not know each other yet
            far.put("greeting", "hello")
            return "hello" in heard

        wait_until(greeted, timeout_s=60)


def client(port: int) -> zenoh.Session:
    """A session that sees nobody but that router."""
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", f'["tcp/127.0.0.1:{port}"]')
    config.insert_json5("scouting/multicast/enabled", "false")
    return zenoh.open(config)


def test_who_is_another_router() -> None:
    group = [f"tcp/router-{number}.zenoh.fleet.svc:7447" for number in range(3)]
    assert other_routers(group, own_host="router-1", port=7447) == [group[0], group[2]]
    assert other_routers(group, own_host="ROUTER-1.zenoh.fleet.svc", port=7447) == [group[0], group[2]]
    assert other_routers(group, own_host="router-1", port=7448) == group
    assert other_routers(group, own_host="router", port=7447) == group


@pytest.mark.parametrize("endpoint", ["router-1:7447", "udp/router-1:7447", "tcp/router-1", "tcp/a:0", "tcp/a:99999"])
def test_what_is_no_router_is_named(endpoint: str) -> None:
    with pytest.raises(ConfigError, match="--connect"):
        other_routers([endpoint], own_host="a", port=7447)
    with start("--connect", endpoint) as router:
        _, err = router.communicate(timeout=END_S)
        assert (router.returncode, "--connect" in err) == (2, True)
