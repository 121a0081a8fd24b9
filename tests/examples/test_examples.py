"""How examples are run here, as a user would run them; and the README's node."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tests.support.processes.processes import END_S, started
from tests.support.waiting import wait_until

ROOT = Path(__file__).resolve().parents[2]


@contextmanager
def running(code: list[str], port: str, log: Path) -> Iterator[None]:
    """Python with the given arguments against the router on `port`, ended by Ctrl-C."""
    environment = {**os.environ, "METAROS_ZENOH_PORT": port}
    with (
        log.open("wb") as out,
        started(
            [sys.executable, "-u", *code], stdout=out, stderr=subprocess.STDOUT, cwd=ROOT, env=environment
        ) as process,
    ):
        yield
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
        assert process.wait(END_S) in (0, 130), log.read_text()


def test_readme_node_hears_itself(zenoh_router: str, tmp_path: Path) -> None:
    block = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)[0]
    script, log = tmp_path / "node.py", tmp_path / "log"
    script.write_text(block)
    with running([str(script)], zenoh_router.rsplit(":", 1)[1], log):
        wait_until(lambda: "heard hello from pip" in log.read_text(), timeout_s=60)
