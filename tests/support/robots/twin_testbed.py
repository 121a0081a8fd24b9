"""A gateway's twins and the agents' side of them, both real, joined by simulated links that cut, delay, repeat and jam.

Real: the store, the desks and the courier of the gateway; each robot's manager, state machine, record on disk, topic
table, channels, budget and the one that sets parameters. Played: the link itself, a robot's nodes, its supervisor and
its updates. Runs on a `HurriedLoop`.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import AsyncExitStack
from pathlib import Path
from random import Random  # noqa: TID251 - the type of an argument
from typing import Any

import orjson

from edge_agent.config.topic_table import TopicTable
from edge_agent.forwarding.channels import Channels
from edge_agent.forwarding.scope import Scope
from edge_agent.link.budget import Budget
from edge_agent.link.byte_budget_override import UplinkLimit
from edge_agent.link.frames import ControlFrame
from edge_agent.nodes.errors import NodeRefusedError
from edge_agent.outbox import IdLog
from edge_agent.twin.record import OWN
from edge_agent.twin.setup import open_twin
from edge_agent.twin.state import TwinFile
from edge_agent.twin.targets import SameVersion
from gateway.domain.robot import Robot
from gateway.errors import RobotOfflineError
from gateway.store import RobotWrite, Store
from metaros._proto import link_pb2
from tests.gateway.fleet.twin_rig import twins_on
from tests.support.processes.fast_loop import HurriedClock
from tests.support.robots.ros_nodes import RosNodes
from tests.support.simulation.sim_disk import SimDisk

__all__ = ["FAULTS", "JAM", "NOT_ALLOWED", "Testbed"]

JAM = "jam"  # a node that nothing gets past as long as it runs
NOT_ALLOWED = "forbidden"  # an entry that no allow-list has
NODES = tuple(f"n{number}" for number in range(5))
TOPICS = tuple(f"t{number}" for number in range(3))
KIND, HASH = "std_msgs/msg/String", "RIHS01_" + "0" * 64
LATE_S = 0.5  # the longest that a frame is on its way
AWAY_S = 4.0  # the longest until a robot comes back
REPEATED = 0.1
FAULTS = ("cut", "cut", "kill", "reboot", "node", "disk", "jam", "forbid")


class Supervisor:
    """What the robot runs of `nodes`; it outlives the agent."""

    def __init__(self) -> None:
        self.changed: Callable[[], None] = lambda: None
        self.handed_over = True
        self.nodes: dict[str, Any] = {}

    async def set_nodes(self, nodes: Mapping[str, Any] | None) -> None:
        """See NodeTable."""
        for name, row in (nodes or {}).items():
            if row.allowed == NOT_ALLOWED:
                raise NodeRefusedError(f"{name}: {row.allowed} is not in the allow-list")
        self.nodes = dict(nodes or {})

    def reported(self) -> dict[str, Any]:
        """See NodeTable."""
        return {name: {"state": "running"} for name in self.nodes}


class Updates(SameVersion):
    """An agent's version as it is wanted."""

    def __init__(self) -> None:
        super().__init__("1.0.0")
        self.wanted: str | None = None

    async def want(self, version: str | None) -> None:
        """See AgentVersion."""
        self.wanted = version


class Wire:
    """One link: frames one after the other, late, some of them twice; none after it is cut."""

    def __init__(self, world: Testbed, agent: Agent) -> None:
        self._world, self._agent = world, agent
        self._queues: dict[str, deque[bytes]] = {"up": deque(), "down": deque()}
        self._stirred = asyncio.Event()
        self.whole = True
        world.spawn(self._carry("up"))
        world.spawn(self._carry("down"))

    def tell(self, frame: link_pb2.AgentFrame) -> None:
        """A frame of the agent's."""
        self.put("up", frame.SerializeToString())

    def put(self, way: str, data: bytes) -> None:
        """A frame begins its way."""
        if self.whole:
            self._queues[way].append(data)
            self._stirred.set()

    def break_off(self) -> None:
        """What is on its way never arrives."""
        self.whole = False
        self._stirred.set()

    async def _carry(self, way: str) -> None:
        queue, rng = self._queues[way], self._world.rng
        while self.whole:
            while not queue and self.whole:
                self._stirred.clear()
                await self._stirred.wait()
            await asyncio.sleep(rng.random() ** 4 * LATE_S)
            if not self.whole or not queue:
                return
            if self._agent.jammed:
                self._agent.cut()
                return
            data = queue.popleft()
            for _ in range(1 + (rng.random() < REPEATED)):
                self._world.arrived(self._agent, way, data)


class Agent:
    """A robot and, while it runs, its agent's process."""

    def __init__(self, world: Testbed, name: str, site: str) -> None:
        self.name, self.labels = name, {"site": site}
        self.disk = SimDisk(world.rng)
        self.ros = RosNodes(f"/{name}", **{node: {} for node in NODES})
        self.supervisor, self.updates = Supervisor(), Updates()
        self.boots, self.lives = 1, 0
        self.restarting = asyncio.Lock()
        self.wire: Wire | None = None
        self.online = False  # its link is whole, as the gateway sees it
        self._held = False  # the gateway has a link of it, dead or alive
        self._world = world
        self._tasks: list[asyncio.Task[Any]] = []

    @property
    def jammed(self) -> bool:
        """Whether what it runs lets nothing pass."""
        return JAM in self.supervisor.nodes

    def start(self) -> None:
        """An agent's process begins on the disk."""
        self.lives += 1
        clock, namespace = HurriedClock(1000.0 * self.boots), f"/{self.name}"
        twin = open_twin(self.disk, TopicTable(), clock, namespace=namespace, boot_id=f"boot-{self.boots}")
        self.limit = UplinkLimit(self.disk, Budget(now_s=clock.monotonic_s()), clock)
        self.channels = Channels(twin.table, IdLog(self.disk), namespace=namespace)
        for topic in TOPICS:
            self.class_of(topic)
        self.confirm, self._clock = twin.confirm, clock
        self.manager, values = twin.build(
            self.ros,
            Scope(namespace),
            clock,
            channels=self.channels,
            look_again=lambda: None,
            limit=self.limit,
            nodes=self.supervisor,
            agent=self.updates,
        )
        manager, actions = self.manager, twin.actions

        async def live() -> None:
            await manager.start(actions)
            self._world.spawn(self._connect(self.lives))
            await manager.run()

        self._tasks = [asyncio.ensure_future(work) for work in (live(), values.run())]

    async def kill(self) -> None:
        """kill -9: what a thread of it has not written by the end is written by nobody."""
        self.cut(again=False)
        for task in self._tasks:
            task.cancel()
        for found in await asyncio.gather(*self._tasks, return_exceptions=True):
            assert isinstance(found, asyncio.CancelledError), found
        self.disk = self.disk.copy()

    def cut(self, *, again: bool = True) -> None:
        """The link goes; the robot sees it at once, the gateway later. The agent connects again by itself."""
        wire, self.wire = self.wire, None
        if wire is None:
            return
        wire.break_off()
        self.manager.link_down()
        self._world.spawn(self._noticed())
        if again:
            self._world.spawn(self._connect(self.lives))

    def unlike(self, document: bytes) -> list[str]:
        """What is really otherwise than the document says; nothing may be left of an earlier one either."""
        wanted, prefix = orjson.loads(document), f"/{self.name}/"
        parameters, rows = wanted.get("parameters", {}), wanted.get("topics", {})
        own = TopicTable()
        topics = {name: rows[name]["class"] if name in rows else own.rule(prefix + name).delivery for name in TOPICS}
        there = {
            "parameters": {node: self.ros.nodes[prefix + node] for node in NODES},
            "topics": {name: self.class_of(name) for name in TOPICS},
            "budget": self.limit.bytes_per_s,
            "nodes": sorted(self.supervisor.nodes),
            "agent": self.updates.wanted,
            "record": TwinFile(self.disk).load(),
        }
        meant = {
            "parameters": {node: parameters.get(node, {}) for node in NODES},
            "topics": {name: "live" if kind == "auto" else kind for name, kind in topics.items()},
            "budget": wanted.get("budget", {}).get("bytes_per_s", 0),
            "nodes": sorted(wanted.get("nodes", {})),
            "agent": wanted.get("agent", {}).get("version"),
            "record": self.confirm.record,
        }
        return [
            f"{section}: {there[section]}, not {meant[section]}"
            for section in meant
            if there[section] != meant[section]
        ]

    def class_of(self, topic: str) -> str:
        """What samples of a topic are sent as now."""
        channel = self.channels.observe(f"/{self.name}/{topic}", KIND, HASH, qos="", keeps_all=False)
        assert channel is not None
        return str(channel.delivery)

    def restart_node(self, node: str) -> None:
        """One of its nodes dies and is started again, with nothing of the twin's."""
        full = f"/{self.name}/{node}"
        self.ros.start(full, str(int(self.ros.life[full]) + 1))

    async def _connect(self, life: int) -> None:
        while self.lives == life and self.wire is None:
            await asyncio.sleep(self._world.rng.random() * AWAY_S)
            if self.lives == life and self.wire is None and self._world.serves and not self._held and not self.jammed:
                self.wire, self._held = Wire(self._world, self), True
                self.manager.link_up(self.wire.tell, link_pb2.Welcome(twin=True))
                self._world.spawn(self._established(self.wire))

    async def _established(self, wire: Wire) -> None:
        """The gateway calls the link whole once the last lane is open, perhaps after the first report."""
        await asyncio.sleep(self._world.rng.random() * LATE_S)
        if wire.whole:
            self.online = True
            self._world.twins.on_online(self.name, True)

    async def _noticed(self) -> None:
        """A new link comes after the gateway has seen the end of the old one: it ends that itself."""
        await asyncio.sleep(self._world.rng.random() * AWAY_S)
        self.online = self._held = False
        self._world.twins.on_online(self.name, False)


class Testbed:
    """One gateway, its robots at their sites, and what was said between them."""

    def __init__(self, folder: Path, rng: Random, robots: Mapping[str, str]) -> None:
        self.rng = rng
        self.agents = {name: Agent(self, name, site) for name, site in robots.items()}
        self.said_to: dict[str, dict[int, bytes]] = {name: {0: OWN.sha256} for name in robots}  # digests by revision
        self.granted: dict[str, set[int]] = {name: {0} for name in robots}
        self.floor = dict.fromkeys(robots, 0)
        self.faults = dict.fromkeys(FAULTS, 0)
        self.serves = False
        self._folder = folder
        self._stack = AsyncExitStack()
        self._tasks: set[asyncio.Task[Any]] = set()

    async def begin(self) -> None:
        """Gateway and robots start."""
        store = await self.start_gateway()
        for agent in self.agents.values():
            store.submit(RobotWrite(Robot(agent.name, labels=agent.labels), 1))
        await store.flush()
        for agent in self.agents.values():
            agent.start()

    async def start_gateway(self) -> Store:
        """On the same data."""
        self._stack = AsyncExitStack()
        store, self.twins = await self._stack.enter_async_context(twins_on("", self._folder, self.send, self.said))
        self.serves = True
        return store

    async def restart_gateway(self) -> None:
        """Its links break, and what it had in memory is gone."""
        self.serves = False
        for agent in self.agents.values():
            agent.cut()
        await self._stack.aclose()
        await self.start_gateway()

    async def end(self) -> None:
        """Nothing is left."""
        for agent in self.agents.values():
            await agent.kill()
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        await self._stack.aclose()

    def spawn(self, work: Any) -> None:
        """In the background; what goes wrong in it is seen by `check`."""
        task = asyncio.ensure_future(work)
        self._tasks.add(task)
        task.add_done_callback(self._over)

    def _over(self, task: asyncio.Task[Any]) -> None:
        if task.cancelled() or task.exception() is None:
            self._tasks.discard(task)

    # -- what is said --------------------------------------------------------------------------------

    def send(self, name: str, frame: link_pb2.GatewayFrame) -> None:
        """A frame of the gateway's."""
        wire = self.agents[name].wire
        if wire is None:
            raise RobotOfflineError(f"robot {name} has no link now")
        if frame.HasField("twin"):
            known = self.said_to[name].setdefault(frame.twin.revision, frame.twin.sha256)
            assert known == frame.twin.sha256, f"revision {frame.twin.revision} of {name} is two documents"
        wire.put("down", frame.SerializeToString())

    def said(self, name: str) -> dict[str, str]:
        """The labels of its Hello."""
        return self.agents[name].labels

    def arrived(self, agent: Agent, way: str, data: bytes) -> None:
        """A frame is at its end."""
        if way == "up":
            self.twins.on_report(agent.name, link_pb2.AgentFrame.FromString(data).twin)
            return
        frame = link_pb2.GatewayFrame.FromString(data)
        if frame.HasField("twin_confirmed"):
            self.granted[agent.name].add(frame.twin_confirmed.revision)
        agent.manager.take(ControlFrame(frame, 0.0))

    # -- faults and promises -----------------------------------------------------------------------------------------

    async def fault(self, kind: str, name: str) -> None:
        """Something goes wrong with a robot; what it is to be of `jam` and `forbid` is the caller's."""
        agent = self.agents[name]
        self.faults[kind] += 1
        if kind == "cut":
            agent.cut()
        elif kind in ("kill", "reboot"):
            async with agent.restarting:
                await agent.kill()
                agent.boots += kind == "reboot"
                agent.start()
        elif kind == "node":
            agent.restart_node(self.rng.choice(NODES))
        elif kind == "disk":
            agent.disk.foreign_bytes = agent.disk.size_bytes
            await asyncio.sleep(self.rng.random() * AWAY_S)
            agent.disk.repair()

    def check(self) -> None:
        """What holds at every moment."""
        for task in self._tasks:
            if task.done() and not task.cancelled() and (error := task.exception()) is not None:
                raise error
        for name, agent in self.agents.items():
            record, active_version = TwinFile(agent.disk).load(), agent.confirm.active_version
            assert self.said_to[name][active_version.revision] == active_version.sha256, "a document that nobody sent"
            assert record.applied.revision in self.granted[name], "kept, and nobody confirmed it"
            assert record.applied.revision >= self.floor[name], "it went back behind what was confirmed"
            self.floor[name] = record.applied.revision
