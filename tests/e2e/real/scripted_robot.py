"""A robot in a thread of its own that lives by its twin as a test says: takes it, lingers on it, refuses, goes back.

Or it obeys commands alone; or it was there once, and is away.
"""

from __future__ import annotations

import asyncio
import json
import threading
from collections.abc import Callable, Coroutine, Iterator
from contextlib import contextmanager
from typing import Any, Literal

from gateway.main import Ready
from metaros._proto import link_pb2
from metaros.fleet.twin import digest
from tests.e2e.real.gateway import Obey, RealGateway
from tests.gateway.harness import CONTROL, ScriptedAgent
from tests.support.waiting import wait_until

__all__ = ["ScriptedRobot", "robot_that_left", "scripted_robot"]

STARTED_S = 60.0
BEAT_S = 3.0  # after 15 s of silence a link counts as dead
Mood = Literal["take", "linger", "refuse", "revert"]


class ScriptedRobot:
    """What a test says of it. `answer` gets a command and gives its payload, or (code, "") for a refusal."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.mood: Mood = "take"
        self.values: dict[str, Any] = {}
        self.document: dict[str, Any] = {}
        self.commands: list[link_pb2.Command] = []
        self.answer: Callable[[link_pb2.Command], bytes | str] = lambda _command: b""
        self._loop: asyncio.AbstractEventLoop | None = None
        self._agent: ScriptedAgent | None = None
        self._newest = self._applied = 0
        self._state = "applied"
        self._why = ("", "")
        self._bytes = b"{}"

    def report(self, **values: Any) -> None:
        """Say what is really so, by sections of `reported`."""
        self.values = {**self.values, **values}
        self.run(self._report())

    def run(self, work: Coroutine[Any, Any, None]) -> None:
        """Do it in the robot's own thread, and wait for it."""
        assert self._loop is not None
        asyncio.run_coroutine_threadsafe(work, self._loop).result(STARTED_S)

    async def begin(self, agent: ScriptedAgent) -> None:
        """Say what is so for the first time; from then on a test may say more."""
        self._agent, self._loop = agent, asyncio.get_running_loop()
        await self._report()

    async def live(self, agent: ScriptedAgent) -> None:
        """Do what comes, until cancelled."""
        while True:
            frame = await agent.frames[CONTROL].get()
            kind = frame.WhichOneof("frame")
            if kind == "command":
                self.commands.append(frame.command)
                said = await asyncio.to_thread(self.answer, frame.command)
                await agent.answer(frame.command, **({"code": said} if isinstance(said, str) else {"payload": said}))
            elif kind == "twin" and frame.twin.revision > self._newest:
                await self._take(frame.twin)
            elif kind == "twin_confirmed" and frame.twin_confirmed.revision == self._newest:
                self._state, self._applied = "applied", self._newest
                await self._report()

    async def confirm(self) -> None:
        """A robot that lingered is ready for its confirmation."""
        self._state = "confirming"
        await self._report()

    async def _take(self, twin: link_pb2.TwinDesired) -> None:
        self._newest, self._why = twin.revision, ("", "")
        if self.mood in ("take", "linger"):
            self._applied, self._bytes, self.document = twin.revision, twin.document, json.loads(twin.document)
        if self.mood == "take":
            self._state = "confirming"
        elif self.mood == "linger":
            self._state = "applying"
        elif self.mood == "refuse":
            self._state, self._why = "refused", ("node_not_allowed", "lidar: this robot does not allow free commands")
        else:
            self._state, self._why = "reverted", ("not_confirmed", "no confirmation within 15 s")
        await self._report()

    async def _report(self) -> None:
        assert self._agent is not None
        code, message = self._why
        said = link_pb2.TwinReport(
            revision=self._newest,
            applied=self._applied,
            state=self._state,
            code=code,
            message=message,
            sha256=digest(self._bytes),
            reported=json.dumps(self.values).encode(),
        )
        await self._agent.send(CONTROL, twin=said)


def robot_that_left(gateway: RealGateway, name: str) -> None:
    """It was linked once, and the gateway knows that it is not any more."""
    with scripted_robot(gateway.ready, name):
        pass
    wait_until(lambda: gateway.ask("GET", f"/robots/{name}")["state"] == "offline")


@contextmanager
def scripted_robot(ready: Ready, name: str, *, obey: Obey | None = None) -> Iterator[ScriptedRobot]:
    """Linked for the length of the block; `obey` is what it does with its frames instead of all that is said above."""
    robot, up, stop = ScriptedRobot(name), threading.Event(), asyncio.Event()
    failed: list[BaseException] = []

    async def run() -> None:
        async with ScriptedAgent(ready, name, session=name.encode().ljust(16, b".")[:16]) as agent:
            await robot.begin(agent)
            tasks = [asyncio.create_task((obey or robot.live)(agent)), asyncio.create_task(_beat(agent))]
            up.set()
            await stop.wait()
            for task in tasks:
                task.cancel()
            for ended in await asyncio.gather(*tasks, return_exceptions=True):
                if not isinstance(ended, asyncio.CancelledError | None):
                    raise ended

    def thread() -> None:
        try:
            asyncio.run(run())
        except BaseException as error:
            failed.append(error)
        finally:
            up.set()

    lives = threading.Thread(target=thread, daemon=True)
    lives.start()
    try:
        assert up.wait(STARTED_S), "the robot did not connect"
        if not failed:
            yield robot
    finally:
        if robot._loop is not None and lives.is_alive():
            robot._loop.call_soon_threadsafe(stop.set)
        lives.join(STARTED_S)
    if failed:
        raise failed[0]


async def _beat(agent: ScriptedAgent) -> None:
    while True:
        await agent.send(CONTROL, heartbeat=link_pb2.Heartbeat())
        await asyncio.sleep(BEAT_S)
