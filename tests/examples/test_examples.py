"""Every example runs as a user would run it, and so does the README's node."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.waiting import wait_until

ROOT = Path(__file__).resolve().parents[2]


def start(code: list[str], port: str, log: Path) -> subprocess.Popen[bytes]:
    """Run Python with the given arguments against the router on `port`."""
    with log.open("wb") as out:
        return subprocess.Popen(
            [sys.executable, "-u", *code],
            stdout=out,
            stderr=subprocess.STDOUT,
            cwd=ROOT,
            env={**os.environ, "METAROS_ZENOH_PORT": port},
        )


def finish(process: subprocess.Popen[bytes]) -> int:
    """Ctrl-C, and the exit code."""
    if process.poll() is None:
        process.send_signal(signal.SIGINT)
    return process.wait(10)


def test_readme_node_hears_itself(zenoh_router: str, tmp_path: Path) -> None:
    (block,) = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
    script, log = tmp_path / "node.py", tmp_path / "log"
    script.write_text(block)
    node = start([str(script)], zenoh_router.rsplit(":", 1)[1], log)
    try:
        wait_until(lambda: "heard hello from pip" in log.read_text(), timeout_s=15)
    finally:
        assert finish(node) in (0, 130)


@pytest.mark.parametrize("listener", ["listener.py", "async_listener.py"])
def test_talker_and_listener(listener: str, zenoh_router: str, tmp_path: Path) -> None:
    port = zenoh_router.rsplit(":", 1)[1]
    heard, said = tmp_path / "heard", tmp_path / "said"
    ears = start([f"examples/{listener}"], port, heard)
    mouth = start(["examples/talker.py"], port, said)
    try:
        wait_until(lambda: heard.read_text().count("Hello World") >= 2, timeout_s=15)
    finally:
        assert finish(mouth) in (0, 130)
        assert finish(ears) in (0, 130)
