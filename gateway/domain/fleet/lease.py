"""Leases to drive a robot and to talk through it: at most one holder of each, and only as long as it keeps renewing.

Of several gateways the one that has the robot's link decides. The others are told who drives and the mark of the
lease's id: by it they know the id when somebody shows it, and nobody can make the id of it.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, replace

from gateway.errors import LeaseRequiredError, LeaseTakenError

__all__ = ["Lease", "LeaseTable", "mark_of"]


@dataclass(frozen=True, slots=True)
class Lease:
    """Who may drive, or talk through, which robot until when (monotonic seconds).

    `lease_id` is "" where another gateway gave the lease to somebody who did not ask here; `mark` is told then.
    """

    lease_id: str
    robot: str
    holder: str
    expires_s: float
    mark: str = ""

    def expires_in_s(self, now_s: float) -> float:
        """Seconds left, never negative."""
        return max(0.0, self.expires_s - now_s)

    def proven_by(self, lease_id: str) -> bool:
        """Whether that is its id."""
        return bool(lease_id) and (self.lease_id == lease_id if self.lease_id else self.mark == mark_of(lease_id))


def mark_of(lease_id: str) -> str:
    """What other gateways are told in place of a lease's id, which nobody can guess."""
    return hashlib.sha256(lease_id.encode()).hexdigest()


class LeaseTable:
    """Leases by robot; pure, `now_s` comes from the caller."""

    def __init__(
        self,
        *,
        valid_s: float,
        listener: Callable[[str, str, bool], None] | None = None,
        endpoint: str = "teleop",
        doing: str = "is driving",
    ) -> None:
        """`listener` hears a robot, a holder, and whether they drive it from now on or do no more.

        `endpoint` is where one takes a lease, and `doing` what its holder does, as people are told it.
        """
        self._endpoint = endpoint
        self._doing = doing
        self._valid_s = valid_s
        self._leases: dict[str, Lease] = {}
        self._learned: dict[str, Lease] = {}  # of robots whose link is at another gateway
        self._listener = listener
        self.revision = 0  # grows whenever somebody else drives a robot, or nobody any more
        self.changed: Callable[[], None] = lambda: None  # somebody drives a robot that is linked here, or does no more

    def find(self, robot: str) -> Lease | None:
        """A robot's lease, perhaps run out a moment ago."""
        return self._leases.get(robot) or self._learned.get(robot)

    def own(self, *, now_s: float) -> list[Lease]:
        """The living leases of which this gateway decides."""
        return [lease for lease in self._leases.values() if lease.expires_s > now_s]

    def learn(self, robot: str, lease: Lease | None) -> None:
        """What the gateway that has the robot's link says of its lease."""
        before = self._learned.pop(robot, None)
        if lease is not None:
            self._learned[robot] = lease
        if before is None or lease is None or before.lease_id != lease.lease_id:
            self.revision += 1

    def take(self, robot: str, holder: str, *, lease_id: str, now_s: float) -> Lease:
        """Give the robot to `holder`; LeaseTakenError while another lease is alive."""
        held = self.holder_of(robot, now_s=now_s)
        if held is not None:
            raise LeaseTakenError(f"{held.holder!r} {self._doing} {robot}", holder=held.holder)
        lease = Lease(lease_id, robot, holder, now_s + self._valid_s)
        self._leases[robot] = lease
        self._report(lease, True)
        return lease

    def renew(self, robot: str, lease_id: str, *, now_s: float) -> Lease:
        """Extend a lease from now; LeaseRequiredError when it is not alive any more."""
        lease = replace(self.check(robot, lease_id, now_s=now_s), expires_s=now_s + self._valid_s)
        (self._leases if robot in self._leases else self._learned)[robot] = lease
        return lease

    def check(self, robot: str, lease_id: str, *, now_s: float) -> Lease:
        """The living lease of that id, or LeaseRequiredError."""
        held = self.holder_of(robot, now_s=now_s)
        if held is None or not held.proven_by(lease_id):
            raise LeaseRequiredError(
                f"{robot} needs a valid {self._endpoint} lease; take one at /api/v1/robots/{robot}/{self._endpoint}"
            )
        return held

    def release(self, robot: str, lease_id: str) -> bool:
        """End a lease; False when it is not the robot's current one."""
        held = self._leases.get(robot)
        if held is None or held.lease_id != lease_id:
            return False
        del self._leases[robot]
        self._report(held, False)
        return True

    def held(self, *, now_s: float) -> int:
        """How many robots that are linked here somebody drives."""
        return sum(lease.expires_s > now_s for lease in self._leases.values())

    def holder_of(self, robot: str, *, now_s: float) -> Lease | None:
        """The robot's living lease, or None."""
        held = self._leases.get(robot)
        if held is not None and held.expires_s <= now_s:
            del self._leases[robot]
            self._report(held, False)
            return None
        if held is None and (held := self._learned.get(robot)) is not None and held.expires_s <= now_s:
            del self._learned[robot]
            self.revision += 1
            return None
        return held

    def expire(self, *, now_s: float) -> None:
        """End the leases that were not renewed in time, also where nobody asks for them."""
        for robot in [*self._leases, *self._learned]:
            self.holder_of(robot, now_s=now_s)

    def _report(self, lease: Lease, taken: bool) -> None:
        self.revision += 1
        if self._listener is not None:
            self._listener(lease.robot, lease.holder, taken)
        self.changed()
