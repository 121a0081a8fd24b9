"""The gateway's and the agent's part of robots' ROS graphs with a link between them that a test cuts and ties."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import metaros
from edge_agent.forwarding.scope import Scope
from edge_agent.link.frames import ControlFrame
from edge_agent.ros.manager import RosManager
from gateway.domain.fleet.lease import LeaseTable
from gateway.errors import RobotOfflineError
from gateway.fleet.command_dispatcher import CommandDispatcher
from gateway.fleet.manager import FleetManager
from gateway.fleet.ros.feature import RosFeature
from metaros._proto import link_pb2
from metaros.clock import SystemClock
from metaros.errors import MetarosError
from metaros.limits import LIMITS

__all__ = ["RosPair", "ros_pair"]

ROBOT = "sim_1"
QUICK = replace(LIMITS, graph_report_s=0.02)  # a graph is told of as soon as it changes


class Half:
    """One gateway: what it knows of robots, goals and offers."""

    def __init__(self, pair: RosPair) -> None:
        self.pair = pair
        self.clock = SystemClock()
        self.commands = CommandDispatcher(self.send, clock=self.clock)
        self.fleet = FleetManager(self.find, self.commands, LeaseTable(valid_s=3.0), clock=self.clock)
        self.ros = RosFeature(self.find, self.commands, self.fleet, self.send, clock=self.clock)
        self.online = False

    def find(self, robot_id: str) -> Any:
        """As the registry does."""
        robot = SimpleNamespace(id=ROBOT, namespace=f"/{ROBOT}")
        return SimpleNamespace(robot=robot, online=self.online, rtt_s=None, channel_of=lambda topic: None)

    def send(self, robot_id: str, frame: link_pb2.GatewayFrame) -> None:
        """To the robot, if it is linked here."""
        if not self.online:
            raise RobotOfflineError(f"robot {robot_id} has no link now")
        self.pair.to_agent(self, link_pb2.GatewayFrame.FromString(frame.SerializeToString()))


class RosPair:
    """`gateway` is the half that the agent is linked with, `link` ties, `cut` cuts."""

    def __init__(self, context: metaros.Context) -> None:
        self.node = metaros.Node("metaros_agent", namespace=f"/{ROBOT}", context=context, enable_parameters=False)
        self.scope = Scope(f"/{ROBOT}")
        self.manager = RosManager(self.node, self.scope, SystemClock(), limits=QUICK)
        self.gateway = Half(self)
        self.running = asyncio.create_task(self.manager.run())
        self.frames: list[link_pb2.AgentFrame] = []
        self._tasks: set[asyncio.Task[None]] = set()

    def link(self, gateway: Half | None = None) -> None:
        """The agent says hello to a gateway."""
        half = self.gateway = gateway or self.gateway
        half.online = True
        half.ros.on_online(ROBOT, True)
        self.manager.link_up(lambda frame: self._to_gateway(half, frame), link_pb2.Welcome(graph=True))

    def cut(self) -> None:
        """The link is gone, for both."""
        self.gateway.online = False
        self.gateway.commands.on_offline(ROBOT)
        self.gateway.ros.on_online(ROBOT, False)
        self.manager.link_down()

    async def restart_agent(self) -> None:
        """Its process ends and begins anew; call it while there is no link."""
        await self.close(whole=False)
        self.manager = RosManager(self.node, self.scope, SystemClock(), limits=QUICK)
        self.running = asyncio.create_task(self.manager.run())

    def to_agent(self, half: Half, frame: link_pb2.GatewayFrame) -> None:
        """A frame of the gateway's."""
        if frame.HasField("command"):
            task = asyncio.create_task(self._carry_out(half, frame.command))
            self._tasks.add(task)
            task.add_done_callback(self._tasks.discard)
        else:
            self.manager.take(ControlFrame(frame, 0.0))

    async def close(self, *, whole: bool = True) -> None:
        """End the agent."""
        self.running.cancel()
        await asyncio.wait({self.running, *self._tasks})
        if whole:
            self.node.close()

    def _to_gateway(self, half: Half, frame: link_pb2.AgentFrame) -> None:
        if half.online and half is self.gateway:
            reported = link_pb2.AgentFrame.FromString(frame.SerializeToString())
            self.frames.append(reported)
            half.ros.on_frame(ROBOT, reported)

    async def _carry_out(self, half: Half, command: link_pb2.Command) -> None:
        result = link_pb2.CommandResult(command_id=command.command_id, ok=True)
        try:
            action = self.manager.actions[command.WhichOneof("action") or ""]
            result.payload = await action(command, command.timeout_ms / 1000)
        except MetarosError as error:
            result.ok, result.code, result.message = False, error.code, str(error)
        half.commands.on_result(ROBOT, result)


@asynccontextmanager
async def ros_pair(context: metaros.Context) -> AsyncIterator[RosPair]:
    """An agent on that context, linked with a gateway."""
    pair = RosPair(context)
    try:
        pair.link()
        yield pair
    finally:
        await pair.close()
