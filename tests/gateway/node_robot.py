"""A scripted robot that lives by its twin and does what its nodes are told: for tests of nodes of remote robots."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import Any

from metaros._proto import link_pb2
from metaros.fleet.twin import digest
from tests.gateway.harness import CONTROL, ScriptedAgent

__all__ = ["Answer", "NodeRobot", "node_robot", "obey"]

Answer = Callable[[link_pb2.Command], tuple[bytes, str]]  # payload and code


class NodeRobot:
    """Takes every twin at once, reports its nodes as running, and answers commands by a function."""

    def __init__(self, agent: ScriptedAgent, answer: Answer) -> None:
        self.agent, self._answer = agent, answer
        self.commands: list[link_pb2.Command] = []
        self.odd: dict[str, Any] = {}  # what it says of nodes beside the twin's

    async def report(self, revision: int = 0, document: bytes = b"{}") -> None:
        """Say that it lives by this."""
        nodes = json.loads(document).get("nodes", {})
        said: dict[str, Any] = {
            name: {"state": "running" if row.get("run", True) else "stopped", "pid": 7, "version": "", "nice": 0}
            for name, row in nodes.items()
        }
        values = json.dumps({"nodes": {**said, **self.odd}}).encode()
        state = link_pb2.TwinReport(
            revision=revision, applied=revision, state="applied", sha256=digest(json.loads(document)), reported=values
        )
        await self.agent.send(CONTROL, twin=state)

    async def run(self) -> None:
        """For ever."""
        await self.report()
        while True:
            frame = await self.agent.frames[CONTROL].get()
            kind = frame.WhichOneof("frame")
            if kind == "twin":
                await self.report(frame.twin.revision, frame.twin.document)
            elif kind == "command":
                self.commands.append(frame.command)
                payload, code = self._answer(frame.command)
                await self.agent.answer(frame.command, payload=payload, code=code)

    @property
    def verbs(self) -> list[tuple[str, str, int]]:
        """Node, verb and signal of the commands that came."""
        found = [item.node_verb for item in self.commands if item.WhichOneof("action") == "node_verb"]
        return [(item.node, item.verb, item.signal) for item in found]


def obey(command: link_pb2.Command) -> tuple[bytes, str]:
    """Every command is done, and answered with nothing."""
    return b"", ""


@asynccontextmanager
async def node_robot(ready: Any, name: str, answer: Answer = obey) -> AsyncIterator[NodeRobot]:
    """Such a robot, linked to the gateway."""
    async with ScriptedAgent(ready, name) as agent:
        found = NodeRobot(agent, answer)
        task = asyncio.create_task(found.run())
        try:
            yield found
        finally:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)
