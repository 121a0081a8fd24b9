"""A gateway on which everything has happened once: robots that answer, history, a recording, people, keys, tokens.

Whoever tries every operation of the API on it reaches what lies behind the first refusal.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from gateway.domain.principal import Role
from gateway.main import Ready
from metaros._proto import link_pb2
from metaros.cdr import codec
from metaros.clock import SystemClock
from metaros.interfaces.std_msgs.msg import String
from metaros.interfaces.std_srvs.srv import Trigger
from metaros.limits import LIMITS
from tests.gateway.harness import DATA, channel, client, running_gateway
from tests.gateway.history.recordings.robot import RecordingRobot, content

SERIES = [
    link_pb2.Series(series_id=1, name="battery.x", topic="/battery", field="x"),
    link_pb2.Series(series_id=2, name="motors.left_motor.temperature", topic="/motors", field="left_motor.temperature"),
]
HOT_S, HOT_C = 15, 85.0  # long and hot enough for a warning, for which no clip is asked
BLOB = content(3000)


@dataclass
class BusyGateway:
    """The gateway, a key that nobody can revoke, its robots, and the stored recording and the alert of each."""

    ready: Ready
    admin: str
    robots: dict[str, RecordingRobot] = field(default_factory=dict)
    recordings: dict[str, str] = field(default_factory=dict)
    alerts: dict[str, str] = field(default_factory=dict)

    async def key(self, role: Role, *robots: str) -> str:
        """A new key of the store."""
        async with client(self.ready, key=self.admin) as http:
            wanted = {"name": "test", "role": role.word, "robots": robots or ("*",)}
            return str((await http.post("/api/v1/keys", json=wanted)).json()["key"])


class Answering(RecordingRobot):
    """A robot whose agent does at once whatever it is told."""

    async def obey(self) -> None:
        """Answer commands for ever, and stay alive."""
        done = codec(Trigger.Response).encode(Trigger.Response(success=True, message="done"))
        async with asyncio.TaskGroup() as group:
            group.create_task(self._beat())
            while True:
                command = (await self.next("command", timeout_s=3600)).command
                kind = command.WhichOneof("action")
                if kind != "save_recording":
                    await self.answer(command, payload=done if kind == "call_service" else b"")

    async def _beat(self) -> None:
        while True:
            for lane in self.lanes:
                await self.send(lane, heartbeat=link_pb2.Heartbeat(sent_ns=SystemClock().wall_ns()))
            await asyncio.sleep(LIMITS.heartbeat_s)


@asynccontextmanager
async def busy_gateway(folder: Path, *names: str, **settings: Any) -> AsyncIterator[BusyGateway]:
    """The gateway with robots of these names online."""
    async with AsyncExitStack() as stack:
        ready = await stack.enter_async_context(running_gateway(folder, **settings))
        made = BusyGateway(ready, (ready.data_dir / "local.key").read_text().strip())
        for name in names:
            robot = Answering(ready, name, session=name.encode().ljust(16)[:16])
            made.robots[name] = await stack.enter_async_context(robot)
            await _fill(made, robot)
            obeying = asyncio.create_task(robot.obey())
            stack.push_async_callback(_ended, obeying)
        yield made


async def _fill(made: BusyGateway, robot: RecordingRobot) -> None:
    """Stored messages, rows of metrics, one stored recording, and a motor that is too hot."""
    await robot.announce(channel(1, f"/{robot.robot}/chatter", "std_msgs/msg/String"), series=SERIES)
    now_ns, text = SystemClock().wall_ns(), codec(String)
    await robot.samples(1, 1, [text.encode(String(data=f"{robot.robot} {n}")) for n in range(20)], stamp_ns=now_ns)
    heat = [(2, now_ns - second * 10**9, HOT_C) for second in range(HOT_S, 0, -1)]
    await robot.rows(1, [*heat, (1, now_ns, 1.0)])
    await robot.next("ack", DATA)
    async with client(made.ready, key=made.admin) as http:
        answer = await http.post(f"/api/v1/robots/{robot.robot}/recordings", json={"last_s": 5})
        recording = str(answer.json()["id"])
    await robot.asked()
    await robot.offer(recording, BLOB)
    assert (await robot.deliver(recording, BLOB)).stored
    made.recordings[robot.robot] = recording
    made.alerts[robot.robot] = await _alert_of(made, robot.robot)


async def _alert_of(made: BusyGateway, robot: str) -> str:
    """The alert of the motor, once it is there."""
    async with client(made.ready, key=made.admin) as http, asyncio.timeout(60):
        while True:
            found = (await http.get("/api/v1/alerts", params={"robot": robot, "cause": "heat"})).json()["alerts"]
            if found:
                return str(found[0]["id"])
            await asyncio.sleep(0.05)


async def _ended(task: asyncio.Task[None]) -> None:
    task.cancel()
    with contextlib.suppress(asyncio.CancelledError):
        await task
