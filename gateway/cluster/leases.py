"""Leases to drive and to talk over several gateways: the home of a robot's link decides, others ask it and are told.

All gateways know who drives and the lease's mark, so that each lists it and lets nobody else at an actuator. The id is
with its holder, the home, and the gateway that asked for it. When the home goes the lease is over everywhere, and the
robot stops by its own watchdogs.
"""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable
from typing import Protocol

from gateway.cluster.asking import HomeOf, ask_home
from gateway.cluster.ports import Mesh
from gateway.domain.lease import Lease, LeaseTable, mark_of
from gateway.errors import GatewayError, RobotOfflineError
from metaros.clock import Clock
from metaros.limits import LIMITS

__all__ = ["Drivers", "LeaseRelay"]

TELL_S = 0.5  # how often all leases are told again: renewals are not told one by one
ASK_S = 6.0  # the home asks the robot's agent


class Drivers(Protocol):
    """The gateway's own desk for driving; it asks the robot's agent."""

    async def take(self, robot_id: str, holder: str, *, lease_id: str) -> object:
        """LeaseTakenError, RobotError."""

    async def renew(self, robot_id: str, lease_id: str) -> Lease:
        """LeaseRequiredError, RobotError."""

    async def end(self, robot_id: str, lease_id: str) -> None:
        """Stop the robot and give the lease back."""

    def on_offline(self, robot_id: str) -> None:
        """The robot's link is gone."""


class LeaseRelay:
    """An arbiter for a `LeaseDesk`; lives on the event loop."""

    def __init__(
        self,
        mesh: Mesh,
        table: LeaseTable,
        desk: Drivers,
        *,
        kind: str = "lease",
        home_of: HomeOf,
        linked: Callable[[str], bool],
        clock: Clock,
    ) -> None:
        """`kind` is what its messages' names begin with; `linked`: a robot's link is at this very gateway."""
        self._kind = kind
        self._mesh = mesh
        self._linked = linked
        self._table = table
        self._desk = desk
        self._home_of = home_of
        self._clock = clock
        self._told = 0  # the number of what was told last
        self._tell = asyncio.Event()
        self._learned: dict[str, tuple[str, int]] = {}  # robot -> its home, and the number that it was told with
        for verb, answer in (("take", self._on_take), ("renew", self._on_renew), ("end", self._on_end)):
            mesh.on_ask(f"{kind}.{verb}", answer)
        mesh.on_tell(f"{kind}.told", self._on_told)
        mesh.on_peer(self._on_peer)
        table.changed = self._tell.set

    # -- robots that are linked elsewhere ----------------------------------------------------------------------------

    def decides(self, robot: str) -> bool:
        """Whether another gateway has the robot's link."""
        return bool(self._home_of(robot))

    async def take(self, robot: str, holder: str, lease_id: str) -> Lease:
        """Ask the robot's home for its lease.

        Raises:
            LeaseTakenError: somebody drives it, at whichever gateway.
            RobotOfflineError: it has no link any more.
            GatewayError: what the robot's agent, or the way to its home, says.
        """
        home, said = self._home_of(robot), {"robot": robot, "holder": holder, "lease": lease_id}
        answer = json.loads(await self._ask(home, "take", robot, said))
        if not home or self._home_of(robot) != home:
            raise RobotOfflineError(f"robot {robot} lost its link while its lease was taken")
        lease = Lease(lease_id, robot, holder, self._clock.monotonic_s() + LIMITS.lease_s, mark_of(lease_id))
        self._learned[robot] = (home, int(answer["number"]))
        self._table.learn(robot, lease)
        return lease

    async def renew(self, robot: str, lease_id: str) -> Lease:
        """More time, at its home; LeaseRequiredError where it is not the living one."""
        answer = await self._ask(self._home_of(robot), "renew", robot, {"robot": robot, "lease": lease_id})
        holder, until_s = str(json.loads(answer)["holder"]), self._clock.monotonic_s() + LIMITS.lease_s
        lease = Lease(lease_id, robot, holder, until_s, mark_of(lease_id))
        known = self._table.find(robot)
        if known is not None and known.lease_id == lease_id:
            self._table.learn(robot, lease)
        return lease

    async def end(self, robot: str, lease_id: str) -> None:
        """Stop the robot and give the lease back; where its home cannot be asked it runs out there."""
        known, home = self._table.find(robot), self._home_of(robot)
        if known is not None and known.proven_by(lease_id):
            self._table.learn(robot, None)
        try:
            await self._ask(home, "end", robot, {"robot": robot, "lease": lease_id})
        except GatewayError:
            return

    async def _ask(self, home: str, verb: str, robot: str, said: dict[str, str]) -> bytes:
        if not home:
            raise RobotOfflineError(f"robot {robot} has no link now")
        payload = json.dumps(said).encode()
        return await ask_home(self._mesh, home, f"{self._kind}.{verb}", payload, robot=robot, timeout_s=ASK_S)

    def on_away(self, robot: str, online: bool) -> None:
        """A robot elsewhere came or went: with its link its lease is over."""
        if not online:
            self._forget(robot)

    def _forget(self, robot: str) -> None:
        self._learned.pop(robot, None)
        self._table.learn(robot, None)
        self._desk.on_offline(robot)

    def _on_peer(self, gateway: str, there: bool) -> None:
        if there:
            self._tell.set()
            return
        for robot in [robot for robot, (home, _) in self._learned.items() if home == gateway]:
            self._forget(robot)

    def _on_told(self, sender: str, payload: bytes) -> None:
        """All the leases of a gateway; what it has not is over, unless it was taken since."""
        told = json.loads(payload)
        number, now_s = int(told["number"]), self._clock.monotonic_s()
        rows = {row[0]: row for row in told["leases"]}
        for robot, (home, known) in list(self._learned.items()):
            if home == sender and known < number and robot not in rows:
                del self._learned[robot]
                self._table.learn(robot, None)
        for robot, holder, mark, left_s in rows.values():
            if self._linked(robot) or self._home_of(robot) not in ("", sender):
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
            await self._desk.renew(robot, lease_id)  # its driver's gateway held it for over
        else:
            await self._desk.take(robot, said["holder"], lease_id=lease_id)
        return json.dumps({"number": self._told}).encode()

    async def _on_renew(self, sender: str, payload: bytes) -> bytes:
        said = json.loads(payload)
        self._require_here(said["robot"])
        lease = await self._desk.renew(said["robot"], said["lease"])
        return json.dumps({"holder": lease.holder}).encode()

    async def _on_end(self, sender: str, payload: bytes) -> bytes:
        said = json.loads(payload)
        if not self._home_of(said["robot"]):
            await self._desk.end(said["robot"], said["lease"])
        return b""

    def _require_here(self, robot: str) -> None:
        """A question for another gateway is not passed on: its asker hears where the robot is soon enough."""
        if self._home_of(robot):
            raise RobotOfflineError(f"robot {robot} has no link at this gateway now")

    def tell(self, gateway: str) -> None:
        """All leases, to a gateway that thinks otherwise of one."""
        self._mesh.tell(gateway, f"{self._kind}.told", self._said())

    def _said(self) -> bytes:
        self._told += 1
        now_s = self._clock.monotonic_s()
        rows = [
            (lease.robot, lease.holder, mark_of(lease.lease_id), lease.expires_in_s(now_s))
            for lease in self._table.own(now_s=now_s)
        ]
        return json.dumps({"number": self._told, "leases": rows}).encode()

    async def run(self) -> None:
        """Tell the others of each change at once, and of all leases every half second while there are any."""
        told = False
        while True:
            try:
                async with asyncio.timeout(TELL_S if told else None):
                    await self._tell.wait()
            except TimeoutError:
                pass
            self._tell.clear()
            told = bool(self._table.own(now_s=self._clock.monotonic_s()))
            self._mesh.tell_all(f"{self._kind}.told", self._said())
