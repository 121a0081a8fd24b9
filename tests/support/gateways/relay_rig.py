"""Gateways with their real managers on a mesh of the tests, and a robot that is linked to one of them."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from types import SimpleNamespace
from typing import Any

from gateway.cluster.relay.relays import Relays
from gateway.domain.fleet.lease import LeaseTable
from gateway.domain.robot import Robot
from gateway.errors import RobotOfflineError
from gateway.fleet.command_dispatcher import CommandDispatcher
from gateway.fleet.manager import FleetManager
from gateway.fleet.ros.feature import RosFeature
from gateway.fleet.talk import TalkManager
from gateway.fleet.teleop import TeleopManager
from metaros._proto import link_pb2
from metaros.clock import ManualClock
from metaros.limits import LIMITS
from tests.support.gateways.fake_mesh import FakeMeshes

__all__ = ["Half", "RelayRig", "relay_rig", "settle"]

ROBOT = "r1"
Answer = Callable[[link_pb2.Command], link_pb2.CommandResult | None]


async def settle() -> None:
    """Let what is on its way between gateways arrive."""
    for _ in range(20):
        await asyncio.sleep(0)


class Half:
    """One gateway, with what the relay needs of it."""

    def __init__(self, rig: RelayRig, gateway_id: str) -> None:
        self.id, self._rig, clock = gateway_id, rig, rig.clock
        self.links = self
        self.fenced: list[int] = []
        self.begun: list[tuple[str, bytes]] = []
        self.commands = CommandDispatcher(self._to_robot, clock=clock)
        self.leases = LeaseTable(valid_s=LIMITS.lease_s)
        self.teleop = TeleopManager(self.find, self.commands, self.leases, self._to_robot, clock=clock)
        self.talks = LeaseTable(valid_s=LIMITS.lease_s, endpoint="talk", doing="is talking through")
        self.talk = TalkManager(self.find, self.commands, self.talks, self._to_robot, clock=clock)
        self.fleet = FleetManager(self.find, self.commands, self.leases, self.talks, clock=clock)
        self.ros = RosFeature(self.find, self.commands, self.fleet, self._to_robot, clock=clock)
        self.told: list[tuple[Any, ...]] = []  # what the change notifications did
        self.command_manager = SimpleNamespace(
            delivery=SimpleNamespace(deliver=lambda robot: self.told.append(("deliver", robot))),
            changed=lambda command_id: self.told.append(("changed", command_id)),
        )
        self.recordings = SimpleNamespace(
            ask=lambda *asked: self.told.append(("ask", *asked)),
            stop=lambda recording_id: self.told.append(("stop", recording_id)),
        )
        self.twins = SimpleNamespace(sender=SimpleNamespace(look=lambda: self.told.append(("look",))))
        invoker = SimpleNamespace(remote=None, invoke=None)
        self.automation = SimpleNamespace(functions=SimpleNamespace(choices=SimpleNamespace(on=False), invoker=invoker))
        around: Any = self
        self.relays = Relays(rig.meshes.join(gateway_id), around, owner_of=self._owner_of, clock=clock)

    @property
    def linked(self) -> bool:
        """Whether the robot's link is here."""
        return self._rig.home == self.id

    def has(self, robot_id: str) -> bool:
        """As `Links` says."""
        return self.linked

    def send(self, robot_id: str, frame: link_pb2.GatewayFrame) -> None:
        """To the robot, where its link is here."""
        if not self.linked:
            raise RobotOfflineError(f"robot {robot_id} has no link now")
        self._rig.hear(link_pb2.GatewayFrame.FromString(frame.SerializeToString()))

    def process_of(self, robot_id: str) -> bytes:
        """As `Links` says."""
        return b"process"

    def started_remotely(self, robot_id: str, session_id: bytes) -> None:
        """Noted."""
        self.begun.append((robot_id, session_id))

    def fence(self, robot_id: str, session_number: int) -> None:
        """Noted."""
        self.fenced.append(session_number)

    def find(self, robot_id: str) -> Any:
        """As the registry does."""
        assert robot_id == ROBOT
        return SimpleNamespace(
            robot=Robot(ROBOT, f"/{ROBOT}"),
            online=bool(self._rig.home),
            here=self.linked,
            rtt_s=None,
            channel_of=lambda topic: None,
        )

    def link_changed(self, online: bool) -> None:
        """The robot's link here began or ended, as the gateway's wiring tells its desks."""
        if not online:
            self.commands.on_offline(ROBOT)
            self.teleop.on_offline(ROBOT)
            self.talk.on_offline(ROBOT)
        self.ros.on_online(ROBOT, online)
        self.relays.on_online(ROBOT, online)

    def says(self, frame: link_pb2.AgentFrame) -> None:
        """The robot says something over its link here."""
        if frame.HasField("result"):
            if not self.relays.on_result(ROBOT, frame.result):
                self.told.append(("result", self.commands.on_result(ROBOT, frame.result)))
        else:
            self.relays.on_ros(ROBOT, frame)

    def _to_robot(self, robot_id: str, frame: link_pb2.GatewayFrame) -> None:
        self.relays.send(robot_id, frame)

    def _owner_of(self, robot_id: str) -> str:
        return self._rig.home if not self.linked else ""


class RelayRig:
    """`link` moves the robot; `frames` is all that it has heard; `answer` is what it says to a command."""

    def __init__(self, names: str) -> None:
        self.clock = ManualClock()
        self.meshes = FakeMeshes()
        self.home = ""
        self.frames: list[link_pb2.GatewayFrame] = []
        self.answer: Answer = lambda command: link_pb2.CommandResult(command_id=command.command_id, ok=True)
        self.halves: dict[str, Half] = {}
        self._running: list[asyncio.Task[None]] = []
        for name in names:
            self.add(name)

    def __getitem__(self, name: str) -> Half:
        return self.halves[name]

    def add(self, name: str) -> Half:
        """Another gateway."""
        half = self.halves[name] = Half(self, name)
        self._running.append(asyncio.create_task(half.relays.run()))
        if self.home:
            half.relays.on_owner(ROBOT)
        return half

    async def close(self) -> None:
        """Nothing goes on."""
        for task in self._running:
            task.cancel()
        await asyncio.gather(*self._running, return_exceptions=True)

    def link(self, name: str) -> None:
        """The robot is linked to that gateway from now on, "" to none."""
        before, self.home = self.home, name
        for half in list(self.halves.values()):
            if half.id == before:
                half.link_changed(False)
            if half.id == name:
                half.link_changed(True)
        for half in list(self.halves.values()):
            if half.id not in (name, before):
                half.relays.on_owner(ROBOT)

    def kill(self, name: str) -> None:
        """That gateway ends without a word."""
        del self.halves[name]
        self.meshes.leave(name)
        if self.home == name:
            self.link("")

    def hear(self, frame: link_pb2.GatewayFrame) -> None:
        """The robot gets a frame; it answers a command."""
        self.frames.append(frame)
        if frame.HasField("command") and (result := self.answer(frame.command)) is not None:
            self.says(link_pb2.AgentFrame(result=result))

    def says(self, frame: link_pb2.AgentFrame) -> None:
        """The robot says something to its home, a moment later."""
        asyncio.get_running_loop().call_soon(self.halves[self.home].says, frame)


@asynccontextmanager
async def relay_rig(names: str = "ab", *, home: str = "a") -> AsyncIterator[RelayRig]:
    """Gateways of these names; the robot is linked to `home`."""
    rig = RelayRig(names)
    await settle()
    if home:
        rig.link(home)
    await settle()
    try:
        yield rig
    finally:
        await rig.close()
