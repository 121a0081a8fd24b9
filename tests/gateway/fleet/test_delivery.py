"""Durable commands against everything that can go wrong between gateways and a robot: each runs at most once, comes to
exactly one end, and a result that was stored stays.

Two gateways on one database, the agent's real handler of durable commands on a disk in memory, and a link between them
that is cut, or connected to the other gateway, at any step; both sides are killed and restarted at any step.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import random  # noqa: TID251 - seeded
import tempfile
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from edge_agent.commands.durable import DurableCommands
from edge_agent.commands.executed_ids import CommandLog
from edge_agent.commands.stored_results import StoredResults
from edge_agent.link.frames import CommandArrived, ControlFrame
from gateway.domain.errors import CommandDeliveredError
from gateway.domain.fleet.command import (
    CANCELLED,
    DONE,
    EXPIRED,
    FAILED,
    Command,
    command_of_wire,
    is_command_id,
    new_command_id,
    wire_id,
)
from gateway.domain.fleet.lease import LeaseTable
from gateway.domain.principal import Principal, Role
from gateway.domain.robot import Robot
from gateway.errors import RobotOfflineError, StoreError
from gateway.fleet.command_dispatcher import CommandDispatcher
from gateway.fleet.command_manager import CommandManager, NewCommand
from gateway.fleet.manager import FleetManager
from gateway.store.commit import Committer
from gateway.store.engine import StoreEngine
from gateway.store.sqlite import SqliteEngine
from gateway.store.writes import RobotWrite
from metaros._proto import link_pb2
from metaros.clock import ManualClock
from metaros.errors import MetarosError
from tests.support.simulation.sim_disk import Crash, SimDisk

ROBOT = "r1"
ANN = Principal(kind="key", id="k1", name="ann", role=Role.OPERATOR, robots=("*",))


class Base:
    """The database of both gateways, without its thread; `fail` makes the next calls fail."""

    def __init__(self, engine: StoreEngine) -> None:
        self.engine = engine
        self.fail = 0

    async def run(self, job: Callable[[StoreEngine], Any]) -> Any:
        self._may_fail()
        await asyncio.sleep(0)
        with self.engine.transaction(write=True):
            return job(self.engine)

    async def read(self, job: Callable[[StoreEngine], Any]) -> Any:
        self._may_fail()
        await asyncio.sleep(0)
        return job(self.engine)

    def _may_fail(self) -> None:
        if self.fail:
            self.fail -= 1
            raise StoreError("a fault")


@dataclass
class View:
    """How a gateway sees the robot."""

    world: World
    gateway: int
    robot: Robot = field(default_factory=lambda: Robot(ROBOT, f"/{ROBOT}"))
    rtt_s: float | None = None

    @property
    def online(self) -> bool:
        return self.world.link is not None and self.world.link.gateway == self.gateway

    @property
    def here(self) -> bool:
        return self.online

    def channel_of(self, topic: str) -> None:
        return None


@dataclass
class Link:
    gateway: int
    down: deque[link_pb2.GatewayFrame] = field(default_factory=deque)
    up: deque[link_pb2.AgentFrame] = field(default_factory=deque)


class LifeDisk:
    """The disk as one process sees it: a crash in a write ends the process, and after it nothing is written."""

    def __init__(self, disk: SimDisk) -> None:
        self.disk = disk
        self.dead = False

    def __getattr__(self, name: str) -> Any:
        call = getattr(self.disk, name)
        if not callable(call):
            return call

        def guarded(*values: Any) -> Any:
            if self.dead:
                raise Crash
            try:
                return call(*values)
            except Crash:
                self.dead = True
                raise

        return guarded


class Life:
    """One process of the agent."""

    def __init__(self, world: World) -> None:
        self.world = world
        self.disk = LifeDisk(world.disk)
        self.tasks: set[asyncio.Task[None]] = set()
        disk: Any = self.disk
        self.log, self.kept = CommandLog(disk), StoredResults(disk)
        self.durable = DurableCommands(self.kept, self.log, world.clock, run=self.run, spawn=self.spawn)

    def spawn(self, work: Any) -> None:
        task = asyncio.get_running_loop().create_task(work)
        self.tasks.add(task)
        task.add_done_callback(lambda done: done.cancelled() or done.exception())

    async def run(self, event: CommandArrived) -> link_pb2.CommandResult:
        command = event.command
        self.world.executed[command.command_id] += 1
        for _ in range(self.world.rng.randrange(20)):
            await asyncio.sleep(0)
        payload = json.dumps({"ran": command.read_log.node}).encode()
        return link_pb2.CommandResult(command_id=command.command_id, ok=True, payload=payload)

    def hear(self, frame: link_pb2.GatewayFrame) -> None:
        clock = self.world.clock
        if frame.HasField("result_stored"):
            self.durable.take(ControlFrame(frame, clock.monotonic_s()))
            return
        event = CommandArrived(frame.command, clock.monotonic_s(), clock.wall_ns())
        link = self.world.link

        def answer(result: link_pb2.CommandResult) -> None:
            if not self.disk.dead and link is not None:
                link.up.append(link_pb2.AgentFrame(result=result))

        try:
            self.durable.arrived(event, answer)
        except MetarosError as error:
            answer(link_pb2.CommandResult(command_id=frame.command.command_id, code=error.code, message=str(error)))

    def linked(self, link: Link) -> None:
        def tell(frame: link_pb2.AgentFrame) -> None:
            if not self.disk.dead:
                link.up.append(frame)

        self.durable.link_up(tell, link_pb2.Welcome())

    def end(self) -> None:
        self.disk.dead = True
        for task in self.tasks:
            task.cancel()


class World:
    """Everything, and what may happen to it."""

    def __init__(self, folder: Path, seed: int) -> None:
        self.rng = random.Random(seed)
        self.clock = ManualClock()
        engine = SqliteEngine(folder)
        engine.connection.execute("PRAGMA synchronous = OFF")
        engine.open()
        Committer(engine).commit([RobotWrite(Robot(ROBOT), 1)], now_ns=1)
        self.base = Base(engine)
        self.disk = SimDisk(self.rng)
        self.executed: Counter[bytes] = Counter()
        self.link: Link | None = None
        self.managers = [self.manager(0), self.manager(1)]
        self.life = Life(self)
        self.ids: list[str] = []
        self.frames: list[link_pb2.GatewayFrame] = []
        self.ended: dict[str, Command] = {}

    def manager(self, number: int) -> CommandManager:
        view = View(self, number)

        def send(robot: str, frame: link_pb2.GatewayFrame) -> None:
            if self.link is None or self.link.gateway != number:
                raise RobotOfflineError(robot)
            self.link.down.append(frame)

        commands = CommandDispatcher(send, clock=self.clock)
        fleet = FleetManager(lambda robot: view, commands, LeaseTable(valid_s=3), clock=self.clock)
        return CommandManager(self.base, commands, fleet, lambda robot: view, send, clock=self.clock)

    async def issue(self) -> None:
        manager = self.managers[self.rng.randrange(2)]
        number = len(self.ids)
        order = NewCommand(
            robot=ROBOT,
            kind="read_log",
            request={"node": f"n{number}"},
            durable=True,
            expires_s=self.rng.choice((5.0, 60.0, 600.0)),
            idempotency=f"key {number}" if self.rng.random() < 0.5 else None,
        )
        with contextlib.suppress(StoreError):
            command = await manager.send(order, ANN)
            self.ids.append(command.id)
            if order.idempotency:
                assert (await self.managers[0].send(order, ANN)).id == command.id

    async def cancel(self) -> None:
        if self.ids:
            with contextlib.suppress(StoreError, CommandDeliveredError):
                await self.managers[self.rng.randrange(2)].cancel(self.rng.choice(self.ids))

    def connect(self, gateway: int | None = None) -> None:
        self.cut()
        self.link = Link(self.rng.randrange(2) if gateway is None else gateway)
        self.managers[self.link.gateway].delivery.on_online(ROBOT, True)
        self.life.linked(self.link)

    def cut(self) -> None:
        if self.link is not None:
            gateway, self.link = self.link.gateway, None
            self.managers[gateway].delivery.on_online(ROBOT, False)

    def kill_agent(self) -> None:
        self.life.end()
        self.cut()
        self.disk.crash_in = None
        while True:
            with contextlib.suppress(Crash):
                self.life = Life(self)
                return

    async def kill_gateway(self) -> None:
        number = self.rng.randrange(2)
        if self.link is not None and self.link.gateway == number:
            self.cut()
        await self.managers[number].delivery.close()
        self.managers[number] = self.manager(number)

    def down(self) -> None:
        if self.link is not None and self.link.down:
            frame = self.link.down.popleft()
            if frame.HasField("command"):
                self.frames.append(frame)
            self.life.hear(frame)

    def replay(self) -> None:
        """An old frame once more, as nobody should send it."""
        if self.frames:
            self.life.hear(self.rng.choice(self.frames))

    def up(self) -> None:
        if self.link is not None and self.link.up:
            result = self.link.up.popleft().result
            self.managers[self.link.gateway].delivery.on_result(ROBOT, result)

    async def step(self, what: str) -> None:
        match what:
            case "issue":
                await self.issue()
            case "cancel":
                await self.cancel()
            case "connect":
                self.connect()
            case "cut":
                self.cut()
            case "kill agent":
                self.kill_agent()
            case "crash in a write":
                self.disk.crash_in = self.rng.randrange(4)
            case "disk fault":
                self.disk.fail_in = self.rng.randrange(3)
            case "store fault":
                self.base.fail = self.rng.randrange(1, 4)
            case "kill gateway":
                await self.kill_gateway()
            case "time":
                self.clock.advance(self.rng.choice((0.1, 3.0, 30.0)))
            case "replay":
                self.replay()
            case "look":
                with contextlib.suppress(StoreError):
                    await self.managers[self.rng.randrange(2)].delivery.look()
        for _ in range(self.rng.randrange(6)):
            self.down()
            self.up()
        for _ in range(self.rng.randrange(12)):
            await asyncio.sleep(0)
        if self.life.disk.dead:
            self.kill_agent()

    async def commands(self) -> list[Command]:
        return [await self.managers[0].get(command_id) for command_id in self.ids]

    async def check(self) -> None:
        """An end is for ever, and nothing ran twice."""
        self.base.fail = 0
        for command in await self.commands():
            if command.over:
                assert self.ended.setdefault(command.id, command) == command
        assert max(self.executed.values(), default=0) <= 1

    async def heal(self) -> None:
        """Nothing fails any more: until every command is over, and the robot keeps nothing."""
        self.disk.repair()
        if self.life.disk.dead:
            self.kill_agent()
        self.connect(0)
        for _ in range(200):
            await self.managers[0].delivery.look()
            for _ in range(100):
                self.down()
                self.up()
                await asyncio.sleep(0)
            if all(command.over for command in await self.commands()) and not len(self.life.kept):
                return
        raise AssertionError(f"not over: {[(c.state, c.code) for c in await self.commands() if not c.over]}")


STEPS = ("issue", "cancel", "connect", "cut", "kill agent", "crash in a write", "disk fault", "store fault")
STEPS += ("kill gateway", "time", "look", "issue", "connect", "look", "look", "connect", "replay")


async def live(folder: Path, seed: int, steps: list[str]) -> None:
    loop: Any = asyncio.get_running_loop()

    def inline(_executor: object, job: Callable[..., Any], *values: Any) -> asyncio.Future[Any]:
        future = loop.create_future()
        try:
            future.set_result(job(*values))
        except BaseException as error:
            future.set_exception(error)
        return future  # type: ignore[no-any-return]

    loop.run_in_executor = inline
    loop.set_exception_handler(lambda loop, context: None)  # a crash leaves tasks behind that nobody asks
    world = World(folder, seed)
    for what in steps:
        await world.step(what)
        await world.check()
    await world.heal()
    await world.check()
    for command in await world.commands():
        ran = world.executed[wire_id(command.id)]
        if command.state == DONE:
            assert ran == 1
            assert json.loads(command.result)["ran"] == json.loads(command.request)["node"]
        elif command.state in (CANCELLED, EXPIRED):
            assert ran == 0, command
        else:
            assert (command.state, command.code) == (FAILED, "interrupted"), command
    for manager in world.managers:
        await manager.delivery.close()
    world.life.end()
    world.base.engine.close()


@given(st.integers(0, 2**32), st.lists(st.sampled_from(STEPS), min_size=5, max_size=60))
@settings(max_examples=40)
def test_at_most_once_and_exactly_one_end(seed: int, steps: list[str]) -> None:
    with tempfile.TemporaryDirectory() as folder:
        asyncio.run(live(Path(folder), seed, steps))


def test_ids_on_the_link() -> None:
    made = new_command_id(1_700_000_000 * 10**9)
    assert is_command_id(made)
    assert command_of_wire(wire_id(made)) == made
    assert len(wire_id(made)) == 16
    assert (command_of_wire(b"x"), is_command_id("8" + made[1:]), is_command_id("x")) == (None, False, False)
