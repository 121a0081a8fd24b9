"""Both clients against a real gateway: the same verbs, one of them from a thread, as a program that blocks has them."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import pytest
import pytest_asyncio

from gateway.domain.principal import Role
from gateway.main import Ready
from metaros._proto import link_pb2
from metaros.cdr import codec
from metaros.client import AsyncClient, Client, Sample, Values
from metaros.client.retries import Retries
from metaros.errors import PeerError, RefusedError, UnavailableError
from metaros.idl.json import from_json
from metaros.interfaces.std_msgs.msg import String
from tests.gateway.harness import CONTROL, RING, ScriptedAgent, channel, knows, running_gateway

KEY = RING.add(role=Role.OPERATOR)
STRING, FIBONACCI, TRIGGER = "std_msgs/msg/String", "example_interfaces/action/Fibonacci", "std_srvs/srv/Trigger"
TWIST = "geometry_msgs/msg/Twist"
STAMP_NS = 1_700_000_000_000_000_000
SPAN = {"start": "2023-11-14T00:00:00Z", "end": "2023-11-15T00:00:00Z"}
T = TypeVar("T")
pytestmark = pytest.mark.asyncio(loop_scope="module")


@dataclass
class World:
    """A gateway, a robot, and both clients."""

    ready: Ready
    agent: ScriptedAgent
    sync: Client
    aio: AsyncClient

    @property
    def robot(self) -> str:
        """Its name."""
        return self.agent.robot

    async def blocking(self, job: Callable[[Client], T]) -> T:
        """What the blocking client answers, in a thread."""
        return await asyncio.to_thread(job, self.sync)


@asynccontextmanager
async def world(ready: Ready, robot: str) -> AsyncIterator[World]:
    """The gateway with one robot more."""
    async with ScriptedAgent(ready, robot) as agent:
        series = link_pb2.Series(series_id=1, name="battery.percentage", topic=f"/{robot}/battery", field="percentage")
        await agent.announce(channel(1, f"/{robot}/chatter", STRING), series=[series])
        await knows(ready, robot, f"/{robot}/chatter")
        async with AsyncClient(ready.url, key=KEY) as aio:
            sync = Client(ready.url, key=KEY)
            try:
                yield World(ready, agent, sync, aio)
            finally:
                await asyncio.to_thread(sync.close)


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def gateway(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[Ready]:
    """It is shared: each test has a robot of its own."""
    async with running_gateway(tmp_path_factory.mktemp("gateway")) as ready:
        yield ready


@pytest_asyncio.fixture(loop_scope="module")
async def here(gateway: Ready, request: pytest.FixtureRequest) -> AsyncIterator[World]:
    async with world(gateway, request.node.name) as made:
        yield made


def cdr(type_name: str, value: dict[str, Any]) -> bytes:
    """A message of that type, by its JSON."""
    return codec(type_name).encode(from_json(type_name, value))


def text(number: int) -> bytes:
    """A std_msgs/String."""
    return cdr(STRING, {"data": f"message {number}"})


async def test_robots_and_what_is_refused(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, world(ready, "sim_1") as here:
        (robot,) = await here.aio.robots()
        assert (robot.id, robot.online, robot.namespace) == ("sim_1", True, "/sim_1")
        assert [item.id for item in await here.blocking(lambda client: client.robots())] == ["sim_1"]
        assert (await here.blocking(lambda client: client.robot("sim_1"))).document["id"] == "sim_1"
        with pytest.raises(RefusedError) as caught:
            await here.aio.robot("nobody")
        assert (caught.value.status, caught.value.reason) == (404, "unknown_robot")
        with pytest.raises(RefusedError) as caught:
            await here.blocking(lambda client: list(client.history("nobody")))
        assert (caught.value.status, caught.value.reason) == (404, "unknown_robot")
    quick = Retries(attempts=2, first_s=0.01)
    with Client(here.ready.url, key=KEY, retries=quick) as late:
        with pytest.raises(UnavailableError):
            await asyncio.to_thread(late.robots)


async def test_publish_and_call(here: World) -> None:
    asking = asyncio.ensure_future(here.aio.publish(here.robot, "chatter", {"data": "hello"}))
    asked = (await here.agent.next("command")).command
    assert asked.publish.topic == f"/{here.robot}/chatter"
    assert asked.publish.payload == cdr(STRING, {"data": "hello"})
    await here.agent.answer(asked)
    await asking
    message = String(data="by class")
    asking = asyncio.ensure_future(here.blocking(lambda client: client.publish(here.robot, "chatter", message)))
    asked = (await here.agent.next("command")).command
    assert asked.publish.payload == cdr(STRING, {"data": "by class"})
    await here.agent.answer(asked, code="busy")
    with pytest.raises(RefusedError) as caught:
        await asking
    assert caught.value.reason == "busy"
    for call in (
        here.aio.call(here.robot, "reset", type_name=TRIGGER),
        here.blocking(lambda client: client.call(here.robot, "reset", type_name=TRIGGER)),
    ):
        answering = asyncio.ensure_future(call)
        asked = (await here.agent.next("command")).command
        payload = cdr(f"{TRIGGER}_Response", {"success": True, "message": "done"})
        await here.agent.answer(asked, payload=payload)
        assert await answering == {"success": True, "message": "done"}


async def test_subscribe(here: World) -> None:

    async def awaited() -> list[Any]:
        found: list[Any] = []
        async for item in here.aio.subscribe("chatter", series="battery.*", robots=f"{here.robot[:-1]}*"):
            found.append(item)
            if {type(one) for one in found} == {Sample, Values}:
                break
        return found

    def blocked(client: Client) -> Any:
        return next(client.subscribe("/*/chatter", decode=False))

    both = [asyncio.ensure_future(awaited()), asyncio.ensure_future(here.blocking(blocked))]
    seq = 1
    while not all(one.done() for one in both):
        await here.agent.samples(1, seq, [text(seq)], stamp_ns=STAMP_NS + seq)
        await here.agent.rows(seq, [(1, STAMP_NS + seq, 0.5)])
        seq += 1
        await asyncio.sleep(0.02)
    found = both[0].result()
    sample = next(item for item in found if isinstance(item, Sample))
    assert (sample.robot, sample.topic, sample.type_name) == (here.robot, f"/{here.robot}/chatter", STRING)
    assert sample.message.data == f"message {sample.seq}"
    values = next(item for item in found if isinstance(item, Values))
    assert (values.robot, dict(values.values)) == (here.robot, {"battery.percentage": 0.5})
    raw = both[1].result()
    assert (raw.message, raw.cdr) == (None, text(raw.seq))


async def test_history_series_and_recordings(here: World) -> None:
    await here.agent.samples(1, 1, [text(number) for number in range(20)], stamp_ns=STAMP_NS)
    await here.agent.rows(1, [(1, STAMP_NS + second * 10**9, float(second)) for second in range(5)])

    async def newest() -> list[str]:
        return [item.message.data async for item in here.aio.history(here.robot, newest_first=True, limit=2, **SPAN)]

    async with asyncio.timeout(60):
        while True:  # until the store has them
            if await newest() == ["message 19", "message 18"] and await here.aio.metrics(here.robot):
                break
            await asyncio.sleep(0.02)
    stored = await here.blocking(lambda client: list(client.history(here.robot, "chatter", **SPAN)))
    assert [item.seq for item in stored] == list(range(1, 21))
    assert await here.aio.snapshot(here.robot) is not None
    assert (await here.blocking(lambda client: client.snapshot(here.robot)))["robot"] == here.robot
    for found in (
        await here.aio.query(here.robot, "battery.percentage", **SPAN),
        await here.blocking(lambda client: client.query(here.robot, ["battery.percentage"], **SPAN)),
    ):
        assert found["battery.percentage"].mean == (0.0, 1.0, 2.0, 3.0, 4.0)
    assert await here.aio.recordings(here.robot) == []
    of_all = await here.blocking(lambda client: client.recordings())  # an alert of another test's robot may be one's
    assert [one for one in of_all if one["robot"] == here.robot] == []


async def test_commands_twin_and_events(here: World) -> None:
    events = here.aio.events(after=0, kinds="robot.*", robots=here.robot)
    event = await anext(events)
    assert (event.kind, event.robot) == ("robot.online", here.robot)
    await events.aclose()
    again = await here.blocking(lambda client: next(client.events(after=0, kinds=["robot.*"], robots=[here.robot])))
    assert again == event
    sending = asyncio.ensure_future(
        here.aio.command(here.robot, "set_uplink", {"bytes_per_s": 50_000}, wait_s=30, idempotency_key="once")
    )
    asked = (await here.agent.next("command")).command
    await here.agent.answer(asked)
    command = await sending
    assert (command.kind, command.state, command.over) == ("set_uplink", "done", True)
    repeated = await here.blocking(
        lambda client: client.command(here.robot, "set_uplink", {"bytes_per_s": 50_000}, idempotency_key="once")
    )
    assert repeated.id == command.id, "the same key is the same command"
    changed = await here.aio.change_twin(here.robot, {"budget": {"bytes_per_s": 50_000}})
    assert changed
    assert (await here.blocking(lambda client: client.twin(here.robot)))["robot"] == here.robot


async def test_a_goal_and_its_end(here: World) -> None:
    for blocking in (False, True):

        def block(client: Client) -> Any:
            return client.send_goal(here.robot, "fibonacci", {"order": 3}, type_name=FIBONACCI)

        goal_of = (
            here.blocking(block)
            if blocking
            else here.aio.send_goal(here.robot, "fibonacci", {"order": 3}, type_name=FIBONACCI)
        )
        sending = asyncio.ensure_future(goal_of)
        asked = (await here.agent.next("command")).command
        await here.agent.answer(asked, payload=cdr(f"{FIBONACCI}_SendGoal_Response", {"accepted": True}))
        goal: Any = await sending
        assert goal.id == asked.send_goal.goal_id.hex()
        status = 6 if blocking else 4  # aborted, succeeded
        result = cdr(f"{FIBONACCI}_GetResult_Response", {"status": status, "result": {"sequence": [0, 1, 1]}})
        reported = link_pb2.GoalEvent(goal_id=asked.send_goal.goal_id, status=status, ended=True, result=result)
        await here.agent.send(CONTROL, goals=link_pb2.GoalEvents(events=[reported]))
        if blocking:
            with pytest.raises(PeerError, match="aborted"):
                await asyncio.to_thread(goal.result)
        else:
            assert await goal.result() == {"sequence": [0, 1, 1]}


async def test_driving_ends_with_the_block(here: World) -> None:

    async def grant(word: str) -> None:
        asked = (await here.agent.next("command")).command
        assert asked.WhichOneof("action") == word
        await here.agent.answer(asked)

    granting = asyncio.ensure_future(grant("grant_lease"))
    async with here.aio.drive(here.robot) as drive:
        await granting
        await drive.move(linear=0.5)
        speeds = [codec(TWIST).decode((await here.agent.next("teleop")).teleop.payload).linear.x for _ in range(2)]
        assert speeds == [0.0, 0.5], "it stands until it is told to move"
        with pytest.raises(RefusedError) as caught:
            await here.blocking(lambda client: hold(client, here.robot))
        assert caught.value.reason == "lease_taken"
        releasing = asyncio.ensure_future(grant("release_lease"))
    await releasing
    driving = asyncio.ensure_future(here.blocking(lambda client: hold(client, here.robot)))
    await grant("grant_lease")
    await grant("release_lease")
    await driving


def hold(client: Client, robot: str) -> None:
    """Drive for a moment."""
    with client.drive(robot, holder="another") as drive:
        drive.move(angular=0.1)
