"""How an agent gives its process back to the loader."""

from __future__ import annotations

import os
import sys

import pytest

from edge_agent.update.restart import RESTART_EXIT_CODE
from tests.support.processes.processes import END_S, started

PROGRAM = """
import os, signal, sys, threading
from edge_agent.update.restart import LoaderInfo, RestartRequest
handover = RestartRequest(patience_s={patience_s})
signal.signal(signal.SIGTERM, lambda *_: print("asked to end", flush=True))
handover.ask(LoaderInfo(loader=(sys.executable, "-c", "import os; print('loader', os.getpid())"), watcher={watcher}))
{rest}
"""

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="there the loader always waits")


def run(rest: str, *, watcher: int, patience_s: float = 60.0) -> tuple[int, str, int]:
    """Exit code, output and process id of such an agent."""
    with started([sys.executable, "-c", PROGRAM.format(rest=rest, watcher=watcher, patience_s=patience_s)]) as process:
        text, _ = process.communicate(timeout=END_S)
        return process.returncode, text, process.pid


def test_the_process_becomes_the_loader() -> None:
    code, text, pid = run("handover.finish()", watcher=0)
    assert (code, text) == (0, f"asked to end\nloader {pid}\n")


def test_a_loader_that_waits_is_reported() -> None:
    code, text, _ = run("handover.finish()", watcher=os.getpid())
    assert (code, text) == (RESTART_EXIT_CODE, "asked to end\n")


@pytest.mark.parametrize("watched", [False, True])
def test_an_agent_whose_parts_do_not_close_ends_all_the_same(watched: bool) -> None:
    code, text, pid = run("threading.Event().wait()", watcher=os.getpid() if watched else 0, patience_s=0.2)
    assert code == (RESTART_EXIT_CODE if watched else 0)
    assert text == "asked to end\n" + ("" if watched else f"loader {pid}\n")
