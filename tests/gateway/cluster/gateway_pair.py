"""Two gateways of one store that have met over a Zenoh router, in this process.

Many tests share them, each with a robot of its own name, so that sessions, leases and twins of one are nothing to
another. The first gateway runs no functions: what is asked of it is run by the second.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx

from gateway.main import Ready
from metaros._proto import link_pb2
from tests.gateway.harness import DATA, ScriptedAgent, channel, client, running_gateway
from tests.support.ports import free_port
from tests.support.servers.postgres import PostgresServer
from tests.support.servers.zenoh_router import inner_router

__all__ = ["Pair", "has", "running_pair", "stored", "until"]

STRING = "std_msgs/msg/String"


@dataclass(frozen=True)
class Pair:
    """Both of them, where they keep their files, and the name of the test's robot."""

    one: Ready
    two: Ready
    folders: tuple[Path, Path]
    robot: str = "sim_1"

    @property
    def path(self) -> str:
        """Where either shows the robot."""
        return f"/api/v1/robots/{self.robot}"

    def topic(self, name: str) -> str:
        """A topic of the robot's."""
        return f"/{self.robot}/{name}"

    def agent(self, ready: Ready, *, number: int = 1, session: bytes = b"s" * 16) -> ScriptedAgent:
        """The robot, once entered linked to one of them."""
        return ScriptedAgent(ready, self.robot, number=number, session=session)

    async def view(self, http: httpx.AsyncClient) -> dict[str, Any]:
        """How a gateway shows the robot."""
        return dict((await http.get(self.path)).json())

    @asynccontextmanager
    async def linked(self) -> AsyncIterator[ScriptedAgent]:
        """The robot is linked to the first, and the second knows its topic `chatter`."""
        async with self.agent(self.one) as agent, agent.beating():
            await agent.announce(channel(1, self.topic("chatter"), STRING))
            await has(self.two, f"{self.path}/topics", self.topic("chatter"))
            yield agent


@asynccontextmanager
async def running_pair(folder: Path, postgres: PostgresServer) -> AsyncIterator[Pair]:
    """Both, which have met."""
    port = free_port()
    shared = {
        "store_url": postgres.schema(),
        "objects_url": f"file://{folder}/objects",
        "cluster": (f"tcp/127.0.0.1:{port}",),
        "master_key": folder / "key" / "master.key",
    }
    (folder / "key").mkdir(mode=0o700)
    folders = (folder / "0", folder / "1")
    with inner_router(port):
        async with AsyncExitStack() as stack:
            one, two = [
                await stack.enter_async_context(running_gateway(own, **shared, functions=own is not folders[0]))
                for own in folders
            ]
            for ready in (one, two):
                await has(ready, "/metrics", "metaros_cluster_peers 1.0")
            yield Pair(one, two, (folders[0] / "data", folders[1] / "data"))


async def stored(agent: ScriptedAgent) -> None:
    """The robot itself is in the database, as all gateways see it: something that came after it is acknowledged."""
    await agent.announce(series=[link_pb2.Series(series_id=1, name="host.cpu", topic="/host", field="cpu")])
    await agent.rows(1, [(1, 1000, 1.0)])
    await agent.next("ack", DATA)


async def until(check: Callable[[], Awaitable[bool]], *, timeout_s: float = 30.0) -> None:
    """Ask until it is so."""
    async with asyncio.timeout(timeout_s):
        while True:
            if await check():
                return
            await asyncio.sleep(0.02)


async def has(ready: Ready, path: str, text: str) -> None:
    """Return as soon as what a gateway answers has that text."""
    said = ""
    try:
        async with client(ready) as http:

            async def there() -> bool:
                nonlocal said
                said = (await http.get(path)).text
                return text in said

            await until(there)
    except TimeoutError:
        raise AssertionError(f"{text!r} is not in {said}") from None
