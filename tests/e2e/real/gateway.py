"""A real gateway in a thread of its own, for browser tests: Playwright keeps an event loop in the test's thread."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Awaitable, Callable, Coroutine, Iterator
from contextlib import AsyncExitStack, contextmanager
from pathlib import Path
from typing import Any

import httpx
import pytest

from gateway.main import Ready, serve
from gateway.settings import Settings
from metaros._proto import link_pb2
from tests.gateway.harness import ScriptedAgent, channel
from tests.support.gateways.memory_authenticator import bearer
from tests.support.gateways.plain_http import TRUSTS_NOBODY
from tests.support.gateways.quick_passwords import make_quick
from tests.support.processes.stack import Stack

__all__ = ["PASSWORD", "RealGateway", "real_gateway", "real_stack", "send"]

PASSWORD = "correct horse battery"
STARTED_S = 60.0
ENDED_S = 60.0
ROBOT_WAITS_S = 3600.0
BEAT_S = 3.0  # after 15 s of silence a link counts as dead


Obey = Callable[[ScriptedAgent], Coroutine[Any, Any, None]]
MoreRobots = Callable[[Ready, AsyncExitStack], Awaitable[None]]


class RealGateway:
    """What a test asks of it; one robot `sim_1` is linked, which can be driven."""

    def __init__(self, ready: Ready, stop: Callable[[], object]) -> None:
        self.ready = ready
        self.url = ready.url
        self.stop = stop
        self.admin = (ready.data_dir / "local.key").read_text().strip()

    def ask(self, method: str, path: str, body: Any = None) -> Any:
        """One request as the gateway's own admin; the answer's document."""
        answer = self.send(method, path, **({} if body is None else {"json": body}))
        assert answer.is_success, answer.text
        return answer.json()

    def send(self, method: str, path: str, *, key: str | None = None, **options: Any) -> httpx.Response:
        """One request as the gateway's own admin, as who has that key, or as nobody ("")."""
        return send(self.url, method, path, key=self.admin if key is None else key, **options)

    def user(self, name: str, role: str, *, password: str = PASSWORD) -> None:
        """Make a user."""
        self.ask("POST", "/users", {"name": name, "role": role, "password": password})

    def link(self, name: str = "") -> str:
        """A sign-in link's address."""
        return str(self.ask("POST", "/auth/links", {"name": name} if name else {})["url"])


def send(
    url: str, method: str, path: str, *, key: str, headers: dict[str, str] | None = None, **options: Any
) -> httpx.Response:
    """One request to a gateway over plain http, as who has that key."""
    with httpx.Client(base_url=f"{url}/api/v1", trust_env=False, verify=TRUSTS_NOBODY, timeout=60) as http:
        return http.request(method, path, headers={**(bearer(key) if key else {}), **(headers or {})}, **options)


@contextmanager
def real_gateway(
    folder: Path,
    *,
    robot: bool = True,
    obey: Obey | None = None,
    more_robots: MoreRobots | None = None,
    **settings: Any,
) -> Iterator[RealGateway]:
    """A gateway on free ports with a robot, ended with the block. Rates of sign-ins are off unless given.

    `obey` is what the robot does with its frames, by default it says yes to every command. `more_robots` adds some.
    Without `robot` nobody is linked.
    """
    started: list[RealGateway] = []
    failed: list[BaseException] = []
    up = threading.Event()

    async def run() -> None:
        stop, loop = asyncio.Event(), asyncio.get_running_loop()
        async with asyncio.TaskGroup() as group:
            ready: asyncio.Future[Ready] = loop.create_future()
            chosen = {"port": 0, "grpc_port": 0, "data_dir": folder / "data", "sign_ins_per_min": 0.0, **settings}
            group.create_task(serve(Settings(**chosen), stop, on_ready=ready.set_result))
            found = await ready
            async with AsyncExitStack() as stack:
                lives = []
                if robot:
                    sim_1 = await stack.enter_async_context(ScriptedAgent(found))
                    await sim_1.announce(channel(1, "/sim_1/cmd_vel", "geometry_msgs/msg/Twist"))
                    lives = [group.create_task((obey or _obey)(sim_1)), group.create_task(_beat(sim_1))]
                if more_robots is not None:
                    await more_robots(found, stack)
                started.append(RealGateway(found, lambda: loop.call_soon_threadsafe(stop.set)))
                up.set()
                await stop.wait()
                for task in lives:
                    task.cancel()

    def live() -> None:
        try:
            asyncio.run(run())
        except BaseException as error:
            failed.append(error)
        finally:
            up.set()

    thread = threading.Thread(target=live, daemon=True)
    with pytest.MonkeyPatch.context() as patch:
        make_quick(patch)
        thread.start()
        begun = up.wait(STARTED_S)
    try:
        assert begun, "the gateway did not start"
        if not started:
            raise failed[0]
        yield started[0]
    finally:
        if started:
            started[0].stop()
        thread.join(ENDED_S)
    if failed:
        raise failed[0]


@contextmanager
def real_stack(folder: Path, **settings: Any) -> Iterator[Stack]:
    """Real programs around a gateway that runs here, which saves the start of its process; nobody is linked yet."""
    stack = Stack(folder)
    ports = {"port": stack.http_port, "grpc_port": stack.grpc_port}
    with real_gateway(folder, robot=False, **ports, **settings), stack:
        yield stack


async def _obey(robot: ScriptedAgent) -> None:
    """Say yes to whatever the robot is told."""
    while True:
        await robot.answer((await robot.next("command", timeout_s=ROBOT_WAITS_S)).command)


async def _beat(robot: ScriptedAgent) -> None:
    """Show that the link lives, as agents do."""
    while True:
        await robot.send(link_pb2.LANE_CONTROL, heartbeat=link_pb2.Heartbeat())
        await asyncio.sleep(BEAT_S)
