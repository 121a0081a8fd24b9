"""The command as a process beside real nodes on a real router."""

from __future__ import annotations

import io
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path

import pytest

import metaros
from metaros.cli.main import main
from metaros.interfaces.std_msgs.msg import String
from metaros.interfaces.std_srvs.srv import Trigger

Run = Callable[..., "Done"]


@pytest.fixture(autouse=True)
def own_runtime_dir(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No `metaros up` of this machine is seen, whatever runs."""
    monkeypatch.setenv("METAROS_RUNTIME_DIR", str(tmp_path / "run"))


@dataclass(frozen=True)
class Done:
    """How a command ended."""

    returncode: int
    stdout: str
    stderr: str


@pytest.fixture
def run_process(zenoh_router: str) -> Run:
    """`run_process("topic", "list")`: the real command on the test's own router."""
    port = zenoh_router.rsplit(":", 1)[1]

    def call(*arguments: str) -> Done:
        command = [sys.executable, "-m", "metaros", *arguments, "--zenoh-port", port]
        done = subprocess.run(command, capture_output=True, text=True, timeout=120)
        return Done(done.returncode, done.stdout, done.stderr)

    return call


@pytest.fixture
def run(zenoh_router: str) -> Run:
    """The same program inside this process, which saves half a second of imports a call."""
    port = zenoh_router.rsplit(":", 1)[1]

    def call(*arguments: str) -> Done:
        out, err = io.StringIO(), io.StringIO()
        with redirect_stdout(out), redirect_stderr(err), pytest.raises(SystemExit) as ended:
            main([*arguments, "--zenoh-port", port])
        sys.stderr.write(err.getvalue())  # a test that fails shows it
        return Done(int(ended.value.code or 0), out.getvalue(), err.getvalue())

    return call


@pytest.fixture
def talker(zenoh_router: str) -> Iterator[metaros.Node]:
    """A node that publishes /chatter at 20 Hz and serves ~/reset."""
    with (
        metaros.Context(connect=zenoh_router) as context,
        metaros.Node("talker", namespace="/demo", context=context) as node,
    ):
        publisher = node.create_publisher(String, "/chatter", 10)
        count = iter(range(1_000_000))

        @node.timer(0.05)
        def tick() -> None:
            publisher.publish(String(data=f"hello {next(count)}"))

        @node.service(Trigger, "~/reset")
        def reset(request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            response.success, response.message = True, "done"
            return response

        executor = metaros.SingleThreadedExecutor()
        executor.add_node(node)
        thread = threading.Thread(target=executor.spin)
        thread.start()
        yield node
        executor.shutdown()
        thread.join()
