"""A function's package, and the program that runs it beside a robot's nodes, in this process."""

from __future__ import annotations

import asyncio
import json
import zipfile
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import metaros
from metaros.automation.functions.sandbox.level import Level
from metaros.automation.robot.policy import FunctionPolicy
from metaros.automation.robot.program import open_package, run_function
from metaros.automation.robot.results import RESULTS
from metaros.clock import Clock, SystemClock
from metaros.interfaces.std_msgs.msg import String

__all__ = ["ReceivedResults", "function_zip", "running_function", "write_function"]

ECHO = "def handler(event, context):\n    return event\n"


def write_function(folder: Path, source: str = ECHO, **document: Any) -> Path:
    """A folder with `app.py` and `function.yaml` (JSON is YAML, too)."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "app.py").write_text(source)
    given = {"name": "echo", "handler": "app.handler", "triggers": [{"topic": "word", "type": "std_msgs/msg/String"}]}
    (folder / "function.yaml").write_text(json.dumps(given | document))
    return folder


def function_zip(folder: Path) -> bytes:
    """The same as one zip file."""
    path = folder.with_suffix(".zip")
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for file in sorted(folder.iterdir()):
            archive.write(file, file.name)
    return path.read_bytes()


@dataclass
class ReceivedResults:
    """What came on functions/results, as an agent hears it."""

    results: list[dict[str, Any]]

    @classmethod
    def on(cls, node: metaros.Node) -> ReceivedResults:
        """Listen."""
        received = cls([])
        node.create_subscription(
            String, f"/sim_1/{RESULTS}", lambda m: received.results.append(json.loads(m.data)), 1000
        )
        return received


@asynccontextmanager
async def running_function(
    package: Path,
    state: Path,
    router: str,
    *,
    policy: FunctionPolicy | None = None,
    clock: Clock | None = None,
    level: Level | None = Level.L1,
) -> AsyncIterator[metaros.Node]:
    """The function of robot sim_1, on a session of its own."""
    await asyncio.to_thread(state.mkdir, parents=True, exist_ok=True)
    with metaros.Context(connect=router) as context:
        node = metaros.Node("function", namespace="/sim_1", context=context)
        stop = asyncio.Event()
        run = run_function(
            open_package(package, state),
            state,
            node=node,
            robot="sim_1",
            policy=policy or FunctionPolicy("/sim_1"),
            clock=clock or SystemClock(),
            stop=stop,
            level=level,
        )
        task = asyncio.create_task(run)
        try:
            yield node
        finally:
            stop.set()
            await task
