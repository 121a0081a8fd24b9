"""A scripted robot for system tests: it follows its twin, fetches signed targets with the agent's own client, and its
nodes restart by the supervisor's own policy; only processes are not started.
"""

from __future__ import annotations

import asyncio
import json
import random  # noqa: TID251 - seeded
import ssl
import zipfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from edge_agent.update.source import Source
from gateway.main import Ready
from metaros._proto import link_pb2
from metaros.clock import SystemClock
from metaros.errors import MetarosError
from metaros.fleet.twin import digest, parse
from metaros.supervise.restart_policy import Exit, History, Quarantine, decide
from tests.gateway.harness import CONTROL, ScriptedAgent

__all__ = ["MARK", "Defects", "StoryRobot"]

MARK = "files/defect.txt"


@dataclass
class Defects:
    """What goes wrong in the story: a version's first trials do well, the next ones do not; a node on some robot."""

    good_trials: int = 2
    bad_trials: int = 2
    looping: set[tuple[str, str]] = field(default_factory=set)  # (robot, node)
    tried: list[str] = field(default_factory=list)
    failed: list[str] = field(default_factory=list)

    def breaks(self, robot: str) -> bool:
        """Whether this trial of a version with a defect goes wrong."""
        self.tried.append(robot)
        bad = self.good_trials < len(self.tried) <= self.good_trials + self.bad_trials
        self.failed += [robot] if bad else []
        return bad


class StoryRobot(ScriptedAgent):
    """Use it as a context; it does what its twin says, one document after another."""

    def __init__(self, ready: Ready, robot: str, folder: Path, defects: Defects) -> None:
        super().__init__(ready, robot, session=robot.encode().ljust(16, b"."))
        self.version = "1.0.0"
        self.revision = 0
        self.document: dict[str, Any] = {}
        self.seen: list[dict[str, Any]] = []  # every document that came
        self._defects = defects
        self._update: dict[str, str] = {"state": "idle", "version": ""}
        self._nodes: dict[str, Any] = {}
        self._source = Source(folder, ready.url, ssl.create_default_context, SystemClock())
        self._tasks: set[asyncio.Task[None]] = set()
        self._updating: asyncio.Task[None] | None = None

    async def __aenter__(self) -> StoryRobot:
        await super().__aenter__()
        self._source.token = self.welcomes[CONTROL].fetch_token
        await self.report("applied")
        self._do(self._live())
        return self

    async def __aexit__(self, *exc: object) -> None:
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        await super().__aexit__(*exc)

    async def report(self, state: str) -> None:
        """Say what is so."""
        reported = {"agent": {"version": self.version, "update": self._update}, "nodes": self._nodes}
        said = link_pb2.TwinReport(
            revision=self.revision,
            applied=self.revision,
            state=state,
            sha256=digest(self.document_bytes),
            reported=json.dumps(reported).encode(),
        )
        await self.send(CONTROL, twin=said)

    document_bytes = b"{}"

    async def _live(self) -> None:
        while True:
            frame = await self.frames[CONTROL].get()
            kind = frame.WhichOneof("frame")
            if kind == "heartbeat":
                await self.send(CONTROL, heartbeat=link_pb2.Heartbeat(sent_ns=1, echo_ns=frame.heartbeat.sent_ns))
            elif kind == "twin" and frame.twin.revision > self.revision:
                await self._apply(frame.twin)
            elif kind == "twin_confirmed" and frame.twin_confirmed.revision == self.revision:
                await self.report("applied")

    async def _apply(self, frame: link_pb2.TwinDesired) -> None:
        twin = parse(frame.document)
        self.revision, self.document_bytes, self.document = frame.revision, frame.document, json.loads(frame.document)
        self.seen.append(self.document)
        self._nodes = {name: self._run(name) for name in twin.nodes or {}}
        await self.report("confirming")
        if twin.agent_version and twin.agent_version not in (self.version, self._update["version"]):
            self._do(self._renew(twin.agent_version))

    def _run(self, node: str) -> dict[str, Any]:
        """A node that runs; or one that ends as soon as it is started, until the policy has had enough."""
        if (self.robot, node) not in self._defects.looping:
            return {"state": "running", "restarts": 0}
        history, now, rng = History(), 0.0, random.Random(1)
        while True:
            decision, history = decide(history.started(now), Exit(code=1), now + 0.1, rng)
            if isinstance(decision, Quarantine):
                return {"state": "quarantined", "restarts": history.restarts, "last_exit": "exit code 1"}
            now = getattr(decision, "at", now)

    async def _renew(self, version: str) -> None:
        """Fetch it as the agent does, run it, and take it back when it does badly."""
        await self._become("downloading", version)
        try:
            broken = await asyncio.to_thread(self._fetch, version)
        except MetarosError as error:
            await self._become("refused", version, str(error))
            return
        before, self.version = self.version, version
        await self._become("trying", version)
        if broken and self._defects.breaks(self.robot):
            self.version = before
            await self._become("rolled_back", version, "not healthy within its window")
            return
        await self._become("healthy", version)

    def _fetch(self, version: str) -> bool:
        with self._source.bundle("agent", "metaros", version) as fetched, zipfile.ZipFile(fetched.path) as archive:
            return MARK in archive.namelist()

    async def _become(self, state: str, version: str, message: str = "") -> None:
        self._update = {"state": state, "version": version, "message": message}
        await self.report("applied")

    def _do(self, work: Any) -> None:
        task = asyncio.get_running_loop().create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
