"""The safe stop of critical nodes: runs the command of their rows when one keeps dying, and keeps the outcome."""

from __future__ import annotations

import asyncio
import logging
import os
import subprocess
from collections.abc import Callable, Mapping
from pathlib import Path

from metaros.limits import LIMITS
from metaros.supervise import parent_death
from metaros.supervise.heartbeats import ENVIRONMENT as HEARTBEAT

__all__ = ["NODE", "SafeStops"]

LOG = logging.getLogger("metaros.supervisor")
NODE = "METAROS_NODE"  # in its environment: whose death it was
_SAID = 300


class SafeStops:
    """At most one a node at a time: a death during it asks for nothing new. `changed` is called when one has ended."""

    def __init__(self, directory: Path, *, changed: Callable[[], None] = lambda: None) -> None:
        self._directory = directory
        self._changed = changed
        self._running: dict[str, asyncio.Task[None]] = {}
        self._outcomes: dict[str, str] = {}

    def outcome(self, node: str) -> str:
        """How its last one went; "" where there was none."""
        return self._outcomes.get(node, "")

    def ask(self, node: str, argv: tuple[str, ...], env: Mapping[str, str]) -> None:
        """Bring the robot to rest."""
        if node in self._running:
            return
        if not argv:
            self._outcomes[node] = "wanted, and the robot's settings name none"
            LOG.error("%s: a safe stop is %s", node, self._outcomes[node])
            return
        self._outcomes[node] = "under way"
        task = self._running[node] = asyncio.create_task(self._stop(node, argv, env))
        task.add_done_callback(lambda _: self._running.pop(node, None))

    def forget(self, node: str) -> None:
        """It is gone from the table."""
        self._outcomes.pop(node, None)

    async def close(self) -> None:
        """Until those that are under way have ended: they are short, and nobody is at rest before."""
        await asyncio.gather(*self._running.values())

    async def _stop(self, node: str, argv: tuple[str, ...], env: Mapping[str, str]) -> None:
        problem = await asyncio.to_thread(self._run, node, argv, env)
        self._outcomes[node] = f"failed: {problem}" if problem else "done"
        LOG.error("%s: safe stop %s", node, self._outcomes[node])
        self._changed()

    def _run(self, node: str, argv: tuple[str, ...], env: Mapping[str, str]) -> str:
        """What went wrong, or nothing."""
        ours = (HEARTBEAT, parent_death.PARENT)
        full = {name: value for name, value in os.environ.items() if name not in ours} | {**env, NODE: node}
        try:
            done = subprocess.run(
                argv,
                cwd=self._directory,
                env=full,
                stdin=subprocess.DEVNULL,
                capture_output=True,
                text=True,
                errors="replace",
                timeout=LIMITS.safe_stop_s,
                check=False,
            )
        except (OSError, subprocess.TimeoutExpired) as error:
            return str(error)[:_SAID]
        said = done.stderr.strip().splitlines()[-1:] or [f"exit code {done.returncode}"]
        return said[0][:_SAID] if done.returncode else ""
