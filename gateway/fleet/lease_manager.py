"""Leases on a robot, to drive it and to talk through it: taken here and at its agent, renewed by use, released."""

from __future__ import annotations

import asyncio
import secrets
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import ClassVar, Protocol

from gateway.domain.fleet.lease import Lease, LeaseTable
from gateway.errors import InvalidRequestError, LeaseRequiredError, RobotError
from gateway.fleet.command_dispatcher import CommandDispatcher
from gateway.fleet.robots import FindRobot, SendFrame, require_online
from metaros._proto import link_pb2
from metaros.clock import Clock
from metaros.idl import names
from metaros.limits import LIMITS

__all__ = ["HeldLease", "LeaseManager", "RemoteLeases"]

GRANT_S = 2.0
MAX_HOLDER_CHARS = 64


@dataclass(slots=True)
class HeldLease:
    """A client's lease on one robot, to drive it or to talk through it."""

    robot: str
    holder: str
    lease_id: str
    topic: str
    seq: int = 0
    gone: asyncio.Event = field(default_factory=asyncio.Event)  # the robot's link went: take the lease again

    @property
    def lost(self) -> bool:
        """Whether the robot's link went since the lease was taken."""
        return self.gone.is_set()


class RemoteLeases(Protocol):
    """Leases of robots that are linked to other gateways: asks those, and raises their errors here."""

    def decides(self, robot: str) -> bool:
        """Whether the robot's link is at another gateway."""

    async def take(self, robot: str, holder: str, lease_id: str) -> Lease:
        """The lease, taken there and at the robot's agent; LeaseTakenError."""

    async def renew(self, robot: str, lease_id: str) -> Lease:
        """More time for it; LeaseRequiredError."""

    async def end(self, robot: str, lease_id: str) -> None:
        """Stop the robot and give the lease back; nothing happens to one that is over."""


class LeaseManager(ABC):
    """Takes, keeps and ends one kind of lease; lives on the event loop."""

    topic: ClassVar[str]  # what the lease is for, in the robot's namespace

    def __init__(
        self, find: FindRobot, commands: CommandDispatcher, leases: LeaseTable, send: SendFrame, *, clock: Clock
    ) -> None:
        self._find = find
        self._commands = commands
        self._leases = leases
        self._send = send
        self._clock = clock
        self._drives: dict[str, HeldLease] = {}
        self.remote: RemoteLeases | None = None  # where this gateway is one of several

    async def take(self, robot_id: str, holder: str, *, lease_id: str = "") -> HeldLease:
        """Take the robot's lease here and at its agent; LeaseTakenError names who has it.

        `lease_id` is one that was made at another gateway of the robot's link here.
        """
        if not 1 <= len(holder) <= MAX_HOLDER_CHARS:
            raise InvalidRequestError(f"holder is a name of 1 to {MAX_HOLDER_CHARS} characters")
        view = require_online(self._find(robot_id))
        topic = names.resolve(self.topic, view.robot.namespace)
        drive = HeldLease(robot_id, holder, lease_id or secrets.token_urlsafe(16), topic)
        await self._grant(drive)
        return drive

    @abstractmethod
    def stop(self, drive: HeldLease) -> None:
        """End what is under way, if the robot can still be told."""

    async def release(self, drive: HeldLease) -> None:
        """Stop and give the lease back."""
        self.stop(drive)
        if self._drives.get(drive.robot) is drive:
            del self._drives[drive.robot]
        if (remote := self._remote_for(drive.robot)) is not None:
            await remote.end(drive.robot, drive.lease_id)
            return
        if not self._leases.release(drive.robot, drive.lease_id) or drive.lost:
            return
        try:
            await self._commands.run(drive.robot, self._releasing(drive.lease_id), timeout_s=GRANT_S)
        except RobotError:
            drive.gone.set()

    async def renew(self, robot_id: str, lease_id: str) -> Lease:
        """More time for a lease, here and at the agent; LeaseRequiredError when it is not the robot's living one."""
        if (remote := self._remote_for(robot_id)) is not None:
            return await remote.renew(robot_id, lease_id)
        lease = self._leases.renew(robot_id, lease_id, now_s=self._clock.monotonic_s())
        await self._report_grant(robot_id, lease_id, lease.holder)
        return lease

    async def end(self, robot_id: str, lease_id: str) -> None:
        """Stop and give a lease back by its id; nothing happens to one that is over."""
        if (remote := self._remote_for(robot_id)) is not None:
            await remote.end(robot_id, lease_id)
            return
        drive = self._drives.get(robot_id)
        if drive is not None and lease_id and drive.lease_id == lease_id:
            await self.release(drive)

    def relayed(self, robot_id: str, teleop: link_pb2.Teleop) -> None:
        """A message under the lease that was made at another gateway, for the robot's link here; it renews the lease.

        Raises:
            LeaseRequiredError: it is not under the robot's living lease, and is not sent.
            RobotOfflineError: the robot has no link now.
        """
        self._leases.renew(robot_id, teleop.lease_id, now_s=self._clock.monotonic_s())
        drive = self._drives.get(robot_id)
        if drive is not None and drive.lease_id == teleop.lease_id:
            drive.seq = max(drive.seq, teleop.seq)  # a stop from here is newer
        self._send(robot_id, self._frame(teleop))

    def rtt_ms(self, robot_id: str) -> float | None:
        """The link's last measured round trip."""
        rtt_s = self._find(robot_id).rtt_s
        return None if rtt_s is None else rtt_s * 1000

    def on_offline(self, robot_id: str) -> None:
        """The robot's link is gone, and with it the lease: the agent has stopped the robot by itself."""
        drive = self._drives.pop(robot_id, None)
        if drive is not None:
            drive.gone.set()
            self._leases.release(robot_id, drive.lease_id)

    @abstractmethod
    def _granting(self, grant: link_pb2.GrantLease) -> link_pb2.Command:
        """The command that tells the agent of a lease of this kind."""

    @abstractmethod
    def _releasing(self, lease_id: str) -> link_pb2.Command:
        """The command that takes one back."""

    @abstractmethod
    def _frame(self, teleop: link_pb2.Teleop) -> link_pb2.GatewayFrame:
        """The frame that takes a message of this kind to the robot."""

    async def _renewed(self, drive: HeldLease) -> Lease:
        """The holder's lease with new time; one that lapsed unclaimed is taken again. LeaseRequiredError."""
        if drive.lost:
            raise LeaseRequiredError(f"robot {drive.robot} lost its link: take the lease again")
        try:
            return self._leases.renew(drive.robot, drive.lease_id, now_s=self._clock.monotonic_s())
        except LeaseRequiredError:
            return await self._grant(drive)

    def _put(self, drive: HeldLease, type_name: str, type_hash: str, payload: bytes, *, sent_ns: int = 0) -> None:
        """Send the holder's next message; `sent_ns` is when it was made, 0 = now."""
        now_ns = self._clock.wall_ns()
        drive.seq += 1
        teleop = link_pb2.Teleop(
            lease_id=drive.lease_id,
            seq=drive.seq,
            sent_ns=min(sent_ns or now_ns, now_ns),
            topic=drive.topic,
            type_name=type_name,
            type_hash=type_hash,
            payload=payload,
        )
        self._send(drive.robot, self._frame(teleop))

    def _remote_for(self, robot_id: str) -> RemoteLeases | None:
        """Whom to ask about a robot whose link is not here."""
        return self.remote if self.remote is not None and self.remote.decides(robot_id) else None

    async def _grant(self, drive: HeldLease) -> Lease:
        if (remote := self._remote_for(drive.robot)) is not None:
            lease = await remote.take(drive.robot, drive.holder, drive.lease_id)
            self._drives[drive.robot] = drive
            return lease
        now_s = self._clock.monotonic_s()
        lease = self._leases.take(drive.robot, drive.holder, lease_id=drive.lease_id, now_s=now_s)
        self._drives[drive.robot] = drive
        try:
            await self._report_grant(drive.robot, drive.lease_id, drive.holder)
        except BaseException:
            self._leases.release(drive.robot, drive.lease_id)
            raise
        return lease

    async def _report_grant(self, robot_id: str, lease_id: str, holder: str) -> None:
        grant = link_pb2.GrantLease(lease_id=lease_id, holder=holder, valid_ms=round(LIMITS.lease_s * 1000))
        await self._commands.run(robot_id, self._granting(grant), timeout_s=GRANT_S)
