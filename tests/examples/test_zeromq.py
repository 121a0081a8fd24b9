"""The ZeroMQ examples through `metaros broker`, as a user would run them, with the talker and the listener."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.examples.test_examples import finish, start
from tests.support.ports import free_port
from tests.support.waiting import wait_until


@contextmanager
def programs(port: str, folder: Path, *commands: list[str]) -> Iterator[list[Path]]:
    """Several Python programs; gives their logs. The last one to start is the first to end."""
    logs = [folder / f"log{number}" for number in range(len(commands))]
    started = []
    try:
        for command, log in zip(commands, logs, strict=True):
            started.append(start(command, port, log))
        yield logs
    finally:
        codes = [finish(process) for process in reversed(started)]
    assert set(codes) <= {0, 130}, [log.read_text() for log in logs]


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
    with programs(zenoh, tmp_path, broker, ears, mouth) as (_, heard, _):
        wait_until(lambda: heard.read_text().count("Hello World") >= 2, timeout_s=30)
