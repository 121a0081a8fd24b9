"""`metaros router` as a process."""

from __future__ import annotations

import json
import signal
import socket
import subprocess
import sys
from contextlib import AbstractContextManager
from pathlib import Path

from metaros.wire import open_router, probe
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
