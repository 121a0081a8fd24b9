"""All relays through a robot's owner: frames, graphs, leases, change notifications and function requests.

The gateway calls one method a hook; which part each concerns is known here alone.
"""

from __future__ import annotations

import asyncio
from typing import Protocol

from gateway.cluster.function_requests import FunctionRequests, Invoker
from gateway.cluster.leases import LeaseRelay, LocalLeases
from gateway.cluster.owner_request import OwnerOf
from gateway.cluster.ports import Mesh
from gateway.cluster.relay.change_notifications import ChangeNotifications, Orders, Recordings, TwinSync
from gateway.cluster.relay.frames import Commands, Leases, Links, Relay
from gateway.cluster.relay.ros import RosFeature, RosRelay
from gateway.cluster.relay.wire import RelayedFrame
from gateway.domain.fleet.lease import LeaseTable
from gateway.fleet.lease_manager import RemoteLeases
from metaros._proto import link_pb2
from metaros.clock import Clock

__all__ = ["LocalParts", "Relays"]


BEGUN = "links.begun"


class _Links(Links, Protocol):
    def process_of(self, robot_id: str) -> bytes:
        """The id of the agent's process that is linked here."""

    def started_remotely(self, robot_id: str, session_id: bytes) -> None:
        """One was linked to another gateway."""

    def fence(self, robot_id: str, session_number: int) -> None:
        """End a session here that is not newer."""


class _Commands(Commands, Protocol):
    def on_offline(self, robot: str) -> None:
        """Its commands will have no result."""


class _Teleop(Leases, LocalLeases, Protocol):
    remote: RemoteLeases | None


class _Ros(RosFeature, Protocol):
    def on_online(self, robot_id: str, online: bool) -> None:
        """A robot's link began or ended."""


class _Twins(Protocol):
    @property
    def sender(self) -> TwinSync:
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


class _Automation(Protocol):
    @property
    def functions(self) -> _Functions:
        """Its functions."""


class LocalParts(Protocol):
    """The gateway's own features."""

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
    def command_manager(self) -> Orders:
        """Commands that are kept."""

    @property
    def recordings(self) -> Recordings:
        """Recordings."""

    @property
    def twins(self) -> _Twins:
        """Desired states."""

    @property
    def automation(self) -> _Automation:
        """Queue, rules and functions."""


class Relays:
    """Make it before the mesh starts; lives on the event loop."""

    def __init__(self, mesh: Mesh, parts: LocalParts, *, owner_of: OwnerOf, clock: Clock) -> None:
        """`owner_of`: the other gateway that has a robot's link; "" = it is here, or nowhere."""
        self._parts = parts
        self._owner_of = owner_of
        self._mesh = mesh
        self._owners: dict[str, str] = {}  # of robots that are linked elsewhere
        self.ros = RosRelay(mesh, parts.links, parts.ros)
        self.leases = LeaseRelay(
            mesh, parts.leases, parts.teleop, owner_of=owner_of, linked=parts.links.has, clock=clock
        )
        self.talks = LeaseRelay(
            mesh, parts.talks, parts.talk, kind="talk", owner_of=owner_of, linked=parts.links.has, clock=clock
        )
        self._lease_relays = (self.leases, self.talks)
        drives = {"teleop": parts.teleop, "talk": parts.talk}
        self.frames = Relay(mesh, parts.links, parts.commands, drives, self.ros, owner_of=owner_of, clock=clock)
        self.notifications = ChangeNotifications(
            mesh, parts.command_manager, parts.recordings, parts.twins.sender, owner_of=owner_of
        )
        functions = parts.automation.functions
        self.function_requests = FunctionRequests(mesh, functions.invoker, on=functions.choices.on)
        self.ros.send_to = self.frames.send_to_requester
        self.frames.on_upstream_frame = parts.ros.on_frame
        self.frames.refused = {"teleop": self.leases.send, "talk": self.talks.send}
        parts.teleop.remote, parts.talk.remote = self.leases, self.talks
        mesh.on_message(BEGUN, self._on_begun)

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
        """A link here began or ended; the gateway's own features were notified before."""
        self.ros.on_online(robot, online)
        if online:
            self._owners.pop(robot, None)
            for relay in self._lease_relays:
                relay.on_online(robot)
            self._mesh.broadcast(BEGUN, RelayedFrame(robot, self._parts.links.process_of(robot)).pack())
        else:
            self.frames.on_offline(robot)
            self.on_owner(robot)

    def on_owner(self, robot: str) -> None:
        """A robot's link at another gateway began, ended, or is at yet another one."""
        before, owner = self._owners.get(robot, ""), self._owner_of(robot)
        if before == owner or self._parts.links.has(robot):
            return
        if before:
            self._parts.commands.on_offline(robot)
            self._parts.ros.on_online(robot, False)
            for relay in self._lease_relays:
                relay.on_remote_robot(robot, False)
        if owner:
            self._owners[robot] = owner
            self._parts.ros.on_online(robot, True)
        else:
            self._owners.pop(robot, None)

    def on_remote_session(self, robot: str, gateway: str, session_number: int) -> None:
        """A robot that is linked here has a newer session at another gateway: the one here is over."""
        self._parts.links.fence(robot, session_number)

    def _on_begun(self, sender: str, payload: bytes) -> None:
        relayed = RelayedFrame.unpack(payload)
        self._parts.links.started_remotely(relayed.robot, relayed.frame)

    async def run(self) -> None:
        """Until cancelled."""
        async with asyncio.TaskGroup() as group:
            group.create_task(self.ros.run())
            for relay in self._lease_relays:
                group.create_task(relay.run())
