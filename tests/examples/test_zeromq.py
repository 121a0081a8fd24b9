"""The ZeroMQ examples through `metaros broker`, as a user would run them, with the talker and the listener."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path

import pytest

from tests.examples.test_examples import running
from tests.support.ports import free_port
from tests.support.waiting import wait_until


@pytest.mark.parametrize(
    ("speaker", "hearer"),
    [("zeromq_publisher.py", "listener.py"), ("talker.py", "zeromq_subscriber.py")],
)
def test_they_hear_each_other(speaker: str, hearer: str, zenoh_router: str, tmp_path: Path) -> None:
    xsub, xpub, zenoh = free_port(), free_port(), zenoh_router.rsplit(":", 1)[1]
    ports = {"zeromq_publisher.py": ["--port", str(xsub)], "zeromq_subscriber.py": ["--port", str(xpub)]}
    broker = ["-m", "metaros", "broker", "--xsub", str(xsub), "--xpub", str(xpub), "--zenoh-port", zenoh]
    ears = [f"examples/{hearer}", *ports.get(hearer, [])]
    mouth = [f"examples/{speaker}", *ports.get(speaker, [])]
    log = tmp_path / "heard"
    with ExitStack() as stack:  # the last one to start is the first to end
        for number, command in enumerate((broker, ears, mouth)):
            stack.enter_context(running(command, zenoh, log if command is ears else tmp_path / f"log{number}"))
        wait_until(lambda: log.read_text().count("Hello World") >= 2)
