"""The line to a supervisor that is about to end: it is no supervisor of ours that ended at once."""

from __future__ import annotations

import asyncio
import os
import sys
from pathlib import Path

import pytest

from edge_agent.nodes.client import SupervisorConnection
from edge_agent.nodes.errors import SupervisorError
from edge_agent.nodes.launcher import BASE_PYTHON, Launcher
from metaros.supervise.control_socket import SOCKET
from metaros.supervise.program import STOPPED, only_one


async def test_one_that_was_stopped_by_hand_is_not_started_again(tmp_path: Path) -> None:
    line = SupervisorConnection(tmp_path, Launcher(tmp_path), lambda found: None)
    with only_one(tmp_path):
        asked = asyncio.create_task(line.ask("list"))
        await asyncio.sleep(0)  # it has seen that one runs
        (tmp_path / STOPPED).touch()
    with pytest.raises(SupervisorError, match="stopped by hand"):
        await asked


@pytest.mark.skipif(sys.platform == "win32", reason="a Unix socket")
async def test_one_that_goes_while_it_is_asked_says_why(tmp_path: Path) -> None:
    async def goes(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.readline()
        (tmp_path / STOPPED).touch()
        writer.close()

    line = SupervisorConnection(tmp_path, Launcher(tmp_path), lambda found: None)
    async with await asyncio.start_unix_server(goes, tmp_path / SOCKET):
        with only_one(tmp_path), pytest.raises(SupervisorError, match="stopped by hand"):
            await line.ask("start", node="a")
    await line.close()


@pytest.mark.skipif(sys.platform == "win32", reason="a script stands for the interpreter")
async def test_one_that_ended_is_started_again(tmp_path: Path) -> None:
    script, reported = tmp_path / "python", tmp_path / "started"
    script.write_text(f"#!/bin/sh\necho once >> {reported}\n")
    script.chmod(0o700)
    environ = {"PATH": os.environ["PATH"], BASE_PYTHON: str(script)}
    line = SupervisorConnection(tmp_path, Launcher(tmp_path, environ=environ), lambda found: None)
    with only_one(tmp_path):
        asked = asyncio.create_task(line.ask("list"))
        await asyncio.sleep(0)
    with pytest.raises(SupervisorError, match="ended at once"):
        await asked
    assert reported.read_text() == "once\n"
