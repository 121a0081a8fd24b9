"""Driving over rosbridge: a client that said so in its address holds the teleop lease while it publishes.

Pages of the robot world publish on cmd_vel and know of no lease. With `?drive=NAME` the gateway takes it for them with
their first message on an actuator, renews it as long as messages come, and gives it back when their socket ends.
Without it, an actuator takes nothing from them: the robot is driven by whoever holds the lease.
"""

from __future__ import annotations

import asyncio

from gateway.api.robot_access import RobotAccess
from gateway.errors import LeaseRequiredError
from gateway.fleet.lease_manager import HeldLease
from metaros.limits import LIMITS

__all__ = ["DriveLeases"]

RENEW_S = LIMITS.lease_s / 3


class DriveLeases:
    """The leases of one client."""

    def __init__(self, access: RobotAccess, holder: str) -> None:
        self._access = access
        self._holder = holder
        self._drives: dict[str, HeldLease] = {}
        self._renewed_s: dict[str, float] = {}

    async def lease_of(self, robot: str) -> str:
        """The lease's id, taken or renewed where that is due.

        Raises:
            LeaseTakenError: somebody else drives.
            ForbiddenError, SignInError: the client may not.
            RobotError: the robot cannot be told.
        """
        teleop, now_s = self._access.services.teleop, self._access.services.clock.monotonic_s()
        drive = self._drives.get(robot)
        if drive is not None and not drive.lost:
            if now_s - self._renewed_s[robot] < RENEW_S:
                return drive.lease_id
            try:
                await teleop.renew(robot, drive.lease_id)
            except LeaseRequiredError:  # nothing was published for so long that it lapsed
                drive = None
        if drive is None or drive.lost:
            self._access.require("robots.drive", robot)
            await self._access.record("robots.drive", f"{robot} as {self._holder}")
            drive = self._drives[robot] = await teleop.take(robot, self._holder)
        self._renewed_s[robot] = now_s
        return drive.lease_id

    async def close(self) -> None:
        """Stop what it drives, and give the leases back."""
        drives, self._drives = list(self._drives.values()), {}
        await asyncio.gather(*(self._access.services.teleop.release(drive) for drive in drives))
