"""One worker whose process is only an outline: the order of what it tells and when it ends."""

from __future__ import annotations

import asyncio
import json
import socket
from pathlib import Path
from typing import Any

import pytest

from metaros.automation.functions.calls import FunctionSpec
from metaros.automation.functions.worker import InitFailure, Worker
from metaros.clock import ManualClock


class Outline:
    """A process that ends when it is killed."""

    pid, logs, output, egress = 0, None, None, None

    def __init__(self, tmp_dir: Path) -> None:
        self.tmp_dir = tmp_dir
        self.listener: socket.socket | None = socket.create_server(("127.0.0.1", 0))
        self._dead = asyncio.Event()

    async def wait(self) -> int:
        await self._dead.wait()
        return 3

    def kill(self) -> None:
        self._dead.set()

    def close(self) -> None:
        """It has nothing open."""


class Telling:
    """A home that notes what it is told."""

    def __init__(self) -> None:
        self.told: list[str] = []

    def free(self, worker: Worker) -> None:
        self.told.append("free")

    def gone(self, worker: Worker) -> None:
        self.told.append("gone")


async def test_one_that_asks_for_its_first_call_and_ends_before_it_has_it_has_failed_to_start(tmp_path: Path) -> None:
    spec = FunctionSpec(key="f", name="f", version="1", arn="", handler="app.handler", code_dir=tmp_path)
    home, launched = Telling(), Outline(tmp_path / "tmp")
    process: Any = launched
    worker = Worker(spec, process, name="w1", owner=home, emit=lambda piece: None, clock=ManualClock())
    starting = asyncio.create_task(worker.start(within_s=60.0))
    await asyncio.sleep(0)
    worker.on_ready()
    worker.on_lost()
    with pytest.raises(InitFailure) as failed:
        await starting
    answer = failed.value.answer
    assert (answer.error_type, failed.value.timed_out) == ("Runtime.ExitError", False)
    assert json.loads(answer.body)["errorMessage"] == "RequestId: w1 Error: Runtime exited before its first call"
    assert home.told == ["free", "gone"]
    await worker.over()
