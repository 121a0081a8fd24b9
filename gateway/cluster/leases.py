"""Drive and talk leases across gateways: a robot's owner, the gateway with its link, grants them and publishes them.

All gateways know who drives and the lease's mark, so that each lists it and lets nobody else at an actuator. The id is
with its holder, the owner, and the gateway that asked for it. When the owner goes the lease is over everywhere, and the
robot stops by its own watchdogs.
"""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable
from typing import Protocol

from gateway.cluster.owner_request import OwnerOf, ask_owner
from gateway.cluster.ports import Mesh
from gateway.domain.fleet.lease import Lease, LeaseTable, mark_of
from gateway.errors import GatewayError, RobotOfflineError
from metaros.clock import Clock
from metaros.limits import LIMITS

__all__ = ["LeaseRelay", "LocalLeases"]

BROADCAST_S = 0.5  # all leases are sent again so often: renewals are not sent one by one
ASK_S = 6.0  # the owner asks the robot's agent


class LocalLeases(Protocol):
    """The gateway's own lease manager; it asks the robot's agent."""

    async def take(self, robot_id: str, holder: str, *, lease_id: str) -> object:
        """LeaseTakenError, RobotError."""

    async def renew(self, robot_id: str, lease_id: str) -> Lease:
        """LeaseRequiredError, RobotError."""

    async def end(self, robot_id: str, lease_id: str) -> None:
        """Stop the robot and give the lease back."""

    def on_offline(self, robot_id: str) -> None:
        """The robot's link is gone."""


class LeaseRelay:
    """The `RemoteLeases` of a `LeaseManager`; lives on the event loop."""

    def __init__(
        self,
        mesh: Mesh,
        table: LeaseTable,
        local: LocalLeases,
        *,
        kind: str = "lease",
        owner_of: OwnerOf,
        linked: Callable[[str], bool],
        clock: Clock,
    ) -> None:
        """`kind` is what its messages' names begin with; `linked`: a robot's link is at this very gateway."""
        self._kind = kind
        self._mesh = mesh
        self._linked = linked
        self._table = table
        self._local = local
        self._owner_of = owner_of
        self._clock = clock
        self._revision = 0  # the number of the last broadcast
        self._changed = asyncio.Event()
        self._learned: dict[str, tuple[str, int]] = {}  # robot -> its owner, and the number that it was told with
        for verb, answer in (("take", self._on_take), ("renew", self._on_renew), ("end", self._on_end)):
            mesh.on_request(f"{kind}.{verb}", answer)
        mesh.on_message(f"{kind}.told", self._on_update)
        mesh.on_peer(self._on_peer)
        table.changed = self._changed.set

    # -- robots that are linked elsewhere ----------------------------------------------------------------------------

    def decides(self, robot: str) -> bool:
        """Whether another gateway has the robot's link."""
        return bool(self._owner_of(robot))

    async def take(self, robot: str, holder: str, lease_id: str) -> Lease:
        """Ask the robot's owner for its lease.

        Raises:
            LeaseTakenError: somebody drives it, at whichever gateway.
            RobotOfflineError: it has no link any more.
            GatewayError: what the robot's agent, or the way to its owner, says.
        """
        owner, said = self._owner_of(robot), {"robot": robot, "holder": holder, "lease": lease_id}
        answer = json.loads(await self._ask(owner, "take", robot, said))
        if not owner or self._owner_of(robot) != owner:
            raise RobotOfflineError(f"robot {robot} lost its link while its lease was taken")
        lease = Lease(lease_id, robot, holder, self._clock.monotonic_s() + LIMITS.lease_s, mark_of(lease_id))
        self._learned[robot] = (owner, int(answer["number"]))
        self._table.learn(robot, lease)
        return lease

    async def renew(self, robot: str, lease_id: str) -> Lease:
        """More time, at its owner; LeaseRequiredError where it is not the living one."""
        answer = await self._ask(self._owner_of(robot), "renew", robot, {"robot": robot, "lease": lease_id})
        holder, until_s = str(json.loads(answer)["holder"]), self._clock.monotonic_s() + LIMITS.lease_s
        lease = Lease(lease_id, robot, holder, until_s, mark_of(lease_id))
        known = self._table.find(robot)
        if known is not None and known.lease_id == lease_id:
            self._table.learn(robot, lease)
        return lease

    async def end(self, robot: str, lease_id: str) -> None:
        """Stop the robot and give the lease back; where its owner cannot be asked it runs out there."""
        known, owner = self._table.find(robot), self._owner_of(robot)
        if known is not None and known.proven_by(lease_id):
            self._table.learn(robot, None)
        try:
            await self._ask(owner, "end", robot, {"robot": robot, "lease": lease_id})
        except GatewayError:
            return

    async def _ask(self, owner: str, verb: str, robot: str, said: dict[str, str]) -> bytes:
        if not owner:
            raise RobotOfflineError(f"robot {robot} has no link now")
        payload = json.dumps(said).encode()
        return await ask_owner(self._mesh, owner, f"{self._kind}.{verb}", payload, robot=robot, timeout_s=ASK_S)

    def on_remote_robot(self, robot: str, online: bool) -> None:
        """A remote robot came online or went offline: its lease ends with its link."""
        if not online:
            self._forget(robot)

    def _forget(self, robot: str) -> None:
        self._learned.pop(robot, None)
        self._table.learn(robot, None)
        self._local.on_offline(robot)

    def _on_peer(self, gateway: str, there: bool) -> None:
        if there:
            self._changed.set()
            return
        for robot in [robot for robot, (owner, _) in self._learned.items() if owner == gateway]:
            self._forget(robot)

    def _on_update(self, sender: str, payload: bytes) -> None:
        """All the leases of a gateway; what it has not is over, unless it was taken since."""
        message = json.loads(payload)
        number, now_s = int(message["number"]), self._clock.monotonic_s()
        rows = {row[0]: row for row in message["leases"]}
        for robot, (owner, known) in list(self._learned.items()):
            if owner == sender and known < number and robot not in rows:
                del self._learned[robot]
                self._table.learn(robot, None)
        for robot, holder, mark, left_s in rows.values():
            if self._linked(robot) or self._owner_of(robot) not in ("", sender):
                continue  # it was there once
            mine = self._table.find(robot)
            if mine is not None and mine.mark == mark and mine.lease_id:
                self._learned[robot] = (sender, number)
                continue  # its driver is here, and renews it here
            if self._learned.get(robot, ("", 0))[1] < number or self._learned[robot][0] != sender:
                self._learned[robot] = (sender, number)
                self._table.learn(robot, Lease("", robot, holder, now_s + float(left_s), mark))

    # -- robots that are linked here ----------------------------------------------------------------------------------

    def on_online(self, robot: str) -> None:
        """A robot is linked here now: what another gateway said of it is over."""
        if robot in self._learned:
            self._forget(robot)

    async def _on_take(self, sender: str, payload: bytes) -> bytes:
        said = json.loads(payload)
        robot, lease_id = said["robot"], said["lease"]
        self._require_here(robot)
        known = self._table.holder_of(robot, now_s=self._clock.monotonic_s())
        if known is not None and known.proven_by(lease_id):
            await self._local.renew(robot, lease_id)  # its driver's gateway held it for over
        else:
            await self._local.take(robot, said["holder"], lease_id=lease_id)
        return json.dumps({"number": self._revision}).encode()

    async def _on_renew(self, sender: str, payload: bytes) -> bytes:
        said = json.loads(payload)
        self._require_here(said["robot"])
        lease = await self._local.renew(said["robot"], said["lease"])
        return json.dumps({"holder": lease.holder}).encode()

    async def _on_end(self, sender: str, payload: bytes) -> bytes:
        said = json.loads(payload)
        if not self._owner_of(said["robot"]):
            await self._local.end(said["robot"], said["lease"])
        return b""

    def _require_here(self, robot: str) -> None:
        """A question for another gateway is not passed on: its asker hears where the robot is soon enough."""
        if self._owner_of(robot):
            raise RobotOfflineError(f"robot {robot} has no link at this gateway now")

    def send(self, gateway: str) -> None:
        """Send all leases to a gateway whose state differs."""
        self._mesh.send(gateway, f"{self._kind}.told", self._said())

    def _said(self) -> bytes:
        self._revision += 1
        now_s = self._clock.monotonic_s()
        rows = [
            (lease.robot, lease.holder, mark_of(lease.lease_id), lease.expires_in_s(now_s))
            for lease in self._table.own(now_s=now_s)
        ]
        return json.dumps({"number": self._revision, "leases": rows}).encode()

    async def run(self) -> None:
        """Broadcast each change at once, and all leases every half second while there are any."""
        repeat = False
        while True:
            try:
                async with asyncio.timeout(BROADCAST_S if repeat else None):
                    await self._changed.wait()
            except TimeoutError:
                pass
            self._changed.clear()
            repeat = bool(self._table.own(now_s=self._clock.monotonic_s()))
            self._mesh.broadcast(f"{self._kind}.told", self._said())
