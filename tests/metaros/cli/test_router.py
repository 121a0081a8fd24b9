"""`metaros router`: what it hosts, joins, refuses, and when it ends."""

from __future__ import annotations

import json
import signal
from contextlib import ExitStack, closing
from pathlib import Path

import pytest
import zenoh

from metaros.cli import router as router_command
from metaros.errors import ConfigError
from metaros.wire import WireSession, open_router, probe
from metaros.wire.router import other_routers
from tests.support.ports import free_port
from tests.support.processes.command_line import Done, call_metaros, program, stop_metaros
from tests.support.processes.processes import END_S, started
from tests.support.waiting import wait_until


def router(*arguments: str) -> Done:
    """It, where it ends by itself."""
    return call_metaros("router", *arguments)


def test_it_hosts_until_reported_to_stop(free_port: int, tmp_path: Path) -> None:
    status = tmp_path / "deep" / "router.json"
    with started(program("router", "--port", str(free_port), "--status-file", str(status))) as process:
        wait_until(status.exists)
        facts = json.loads(status.read_text())
        assert (facts["pid"], facts["ready"], facts["zenoh_port"]) == (process.pid, True, free_port)
        assert probe(free_port) == "zenoh"
        process.send_signal(signal.SIGTERM)
        out, err = process.communicate(timeout=END_S)
        assert process.returncode == 0
        assert out.splitlines()[-1] == "stopped"
        assert err == ""


def test_where_one_runs_there_is_nothing_to_do(zenoh_port: str) -> None:
    done = router("--port", zenoh_port)
    assert (done.code, "runs already" in done.out) == (0, True)


def test_a_foreign_program_on_the_port_is_named(foreign_port: int) -> None:
    done = router("--port", str(foreign_port))
    assert done.code == 2
    assert f"port {foreign_port} is in use by" in done.err
    assert "--port PORT" in done.err


def test_the_understudy_takes_over(free_port: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(router_command, "STANDBY_STEP_S", 0.02)
    status = tmp_path / "standby.json"
    first = open_router(free_port)

    def taken_over(out: str) -> bool:
        if "waiting" in out and not first.session.is_closed():
            assert not status.exists()
            first.close()
        return status.exists()

    done = stop_metaros(
        *("router", "--port", str(free_port), "--standby", "--status-file", str(status)),
        when=lambda out: taken_over(out) and probe(free_port) == "zenoh",
    )
    assert (done.code, done.out.splitlines()[-1]) == (0, "stopped")


def test_a_protected_router_says_what_sessions_need_and_lets_nobody_else_in(free_port: int, tmp_path: Path) -> None:
    status, folder = tmp_path / "router.json", tmp_path / "zenoh"
    protected = ("--zenoh-profile", "protected", "--zenoh-credentials", str(folder))

    def guarded(_: str) -> bool:
        if not status.exists():
            return False
        assert probe(free_port) == "foreign"  # no password, no session
        environ = {"ZENOH_SESSION_CONFIG_URI": str(folder / "node.json5")}
        with closing(WireSession(environ=environ)) as session:
            assert session.connected()
        return True

    done = stop_metaros(
        *("router", "--port", str(free_port), *protected, "--status-file", str(status)), when=guarded, by=signal.SIGTERM
    )
    assert f"ZENOH_SESSION_CONFIG_URI={folder}/node.json5" in done.out


def test_an_open_router_is_not_taken_for_a_protected_one(zenoh_port: str, tmp_path: Path) -> None:
    done = router("--port", zenoh_port, "--zenoh-profile", "protected", "--zenoh-credentials", str(tmp_path))
    assert (done.code, "an open Zenoh router" in done.err) == (2, True)


def test_routers_that_name_each_other_are_one_network() -> None:
    ports = [free_port(), free_port()]
    group = [f"tcp/127.0.0.1:{port}" for port in ports]  # each is told of both
    received: list[str] = []
    with ExitStack() as stack:
        stack.enter_context(open_router(ports[1], connect=group))
        far = stack.enter_context(client(ports[1]))
        near: list[zenoh.Session] = []

        def greeted(out: str) -> bool:
            if "Zenoh router on" not in out:
                return False
            if not near:
                near.append(stack.enter_context(client(ports[0])))
                near[0].declare_subscriber("greeting", lambda sample: received.append(sample.payload.to_string()))
            far.put("greeting", "hello")  # again and again: the routers may not know each other yet
            return "hello" in received

        options = [option for endpoint in group for option in ("--connect", endpoint)]
        assert stop_metaros("router", "--port", str(ports[0]), *options, when=greeted).code == 0


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


def test_what_is_no_router_is_named() -> None:
    for endpoint in ("router-1:7447", "udp/router-1:7447", "tcp/router-1", "tcp/a:0", "tcp/a:99999"):
        with pytest.raises(ConfigError, match="--connect"):
            other_routers([endpoint], own_host="a", port=7447)
    done = router("--connect", "udp/router-1:7447")
    assert (done.code, "--connect" in done.err) == (2, True)
