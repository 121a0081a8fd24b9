"""Everything that goes through a robot's home, put together: frames, graphs, leases, nudges and errands.

The gateway calls one method a hook; which part each concerns is known here alone.
"""

from __future__ import annotations

import asyncio
from typing import Protocol

from gateway.cluster.asking import HomeOf
from gateway.cluster.errands import Errands, Invoker
from gateway.cluster.leases import Drivers, LeaseRelay
from gateway.cluster.ports import Mesh
from gateway.cluster.relay import Commands, Drives, Links, Relay
from gateway.cluster.relay_nudges import Courier, Nudges, Orders, Recordings
from gateway.cluster.relay_ros import RosRelay, RosSide
from gateway.cluster.relay_wire import Parcel
from gateway.domain.lease import LeaseTable
from gateway.fleet.lease_desk import Arbiter
from metaros._proto import link_pb2
from metaros.clock import Clock

__all__ = ["Around", "Relays"]


BEGUN = "links.begun"


class _Links(Links, Protocol):
    def process_of(self, robot_id: str) -> bytes:
        """The id of the agent's process that is linked here."""

    def begun_elsewhere(self, robot_id: str, session_id: bytes) -> None:
        """One was linked to another gateway."""

    def fence(self, robot_id: str, session_number: int) -> None:
        """End a session here that is not newer."""


class _Commands(Commands, Protocol):
    def on_offline(self, robot: str) -> None:
        """Its commands will have no result."""


class _Teleop(Drives, Drivers, Protocol):
    arbiter: Arbiter | None


class _Ros(RosSide, Protocol):
    def on_online(self, robot_id: str, online: bool) -> None:
        """A robot's link began or ended."""


class _Twins(Protocol):
    @property
    def courier(self) -> Courier:
        """Takes desired states to robots."""


class _Choices(Protocol):
    @property
    def on(self) -> bool:
        """Whether functions run here."""


class _Functions(Protocol):
    @property
    def choices(self) -> _Choices:
        """What was chosen at the start."""

    @property
    def invoker(self) -> Invoker:
        """Calls functions."""


class _Reacting(Protocol):
    @property
    def functions(self) -> _Functions:
        """Its functions."""


class Around(Protocol):
    """The gateway's own desks."""

    @property
    def links(self) -> _Links:
        """The robots that are linked here."""

    @property
    def commands(self) -> _Commands:
        """Commands under way that were asked for here."""

    @property
    def teleop(self) -> _Teleop:
        """Who drives."""

    @property
    def leases(self) -> LeaseTable:
        """Who may drive."""

    @property
    def talk(self) -> _Teleop:
        """Who talks."""

    @property
    def talks(self) -> LeaseTable:
        """Who may talk."""

    @property
    def ros(self) -> _Ros:
        """Graphs, goals, offers."""

    @property
    def orders(self) -> Orders:
        """Commands that are kept."""

    @property
    def recordings(self) -> Recordings:
        """Recordings."""

    @property
    def twins(self) -> _Twins:
        """Desired states."""

    @property
    def reacting(self) -> _Reacting:
        """Queue, rules and functions."""


class Relays:
    """Make it before the mesh starts; lives on the event loop."""

    def __init__(self, mesh: Mesh, around: Around, *, home_of: HomeOf, clock: Clock) -> None:
        """`home_of`: the other gateway that has a robot's link; "" = it is here, or nowhere."""
        self._around = around
        self._home_of = home_of
        self._mesh = mesh
        self._homes: dict[str, str] = {}  # of robots that are linked elsewhere
        self.ros = RosRelay(mesh, around.links, around.ros)
        self.leases = LeaseRelay(
            mesh, around.leases, around.teleop, home_of=home_of, linked=around.links.has, clock=clock
        )
        self.talks = LeaseRelay(
            mesh, around.talks, around.talk, kind="talk", home_of=home_of, linked=around.links.has, clock=clock
        )
        self._lease_relays = (self.leases, self.talks)
        drives = {"teleop": around.teleop, "talk": around.talk}
        self.frames = Relay(mesh, around.links, around.commands, drives, self.ros, home_of=home_of, clock=clock)
        self.nudges = Nudges(mesh, around.orders, around.recordings, around.twins.courier, home_of=home_of)
        functions = around.reacting.functions
        self.errands = Errands(mesh, functions.invoker, on=functions.choices.on)
        self.ros.tell_one = self.frames.tell_asker
        self.frames.came_up = around.ros.on_frame
        self.frames.refused = {"teleop": self.leases.tell, "talk": self.talks.tell}
        around.teleop.arbiter, around.talk.arbiter = self.leases, self.talks
        mesh.on_tell(BEGUN, self._on_begun)

    @property
    def owed(self) -> int:
        """How many results of robots that are linked here other gateways wait for."""
        return self.frames.owed

    def send(self, robot: str, frame: link_pb2.GatewayFrame) -> None:
        """To the robot's control lane, wherever its link is; RobotOfflineError when it has none."""
        self.frames.send(robot, frame)

    def on_result(self, robot: str, result: link_pb2.CommandResult) -> bool:
        """A robot that is linked here answers; whether that was for another gateway."""
        return self.frames.on_result(robot, result)

    def on_ros(self, robot: str, frame: link_pb2.AgentFrame) -> None:
        """A robot that is linked here says something of its graph, of goals or of offers."""
        self.ros.on_frame(robot, frame)

    def on_online(self, robot: str, online: bool) -> None:
        """A link here began or ended; the gateway's own desks have heard of it."""
        self.ros.on_online(robot, online)
        if online:
            self._homes.pop(robot, None)
            for relay in self._lease_relays:
                relay.on_online(robot)
            self._mesh.tell_all(BEGUN, Parcel(robot, self._around.links.process_of(robot)).pack())
        else:
            self.frames.on_offline(robot)
            self.on_home(robot)

    def on_home(self, robot: str) -> None:
        """A robot's link at another gateway began, ended, or is at yet another one."""
        before, home = self._homes.get(robot, ""), self._home_of(robot)
        if before == home or self._around.links.has(robot):
            return
        if before:
            self._around.commands.on_offline(robot)
            self._around.ros.on_online(robot, False)
            for relay in self._lease_relays:
                relay.on_away(robot, False)
        if home:
            self._homes[robot] = home
            self._around.ros.on_online(robot, True)
        else:
            self._homes.pop(robot, None)

    def on_elsewhere(self, robot: str, gateway: str, session_number: int) -> None:
        """A robot that is linked here has a newer session at another gateway: the one here is over."""
        self._around.links.fence(robot, session_number)

    def _on_begun(self, sender: str, payload: bytes) -> None:
        parcel = Parcel.unpack(payload)
        self._around.links.begun_elsewhere(parcel.robot, parcel.frame)

    async def run(self) -> None:
        """Until cancelled."""
        async with asyncio.TaskGroup() as group:
            group.create_task(self.ros.run())
            for relay in self._lease_relays:
                group.create_task(relay.run())
