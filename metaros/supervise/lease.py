"""Leases of migratable nodes: a node runs here only while its lease holds, by this machine's own clock. Pure.

The gateway gives a node's next lease to another robot once this one's has ended. So the end is hard: a node is asked to
stop so long before it that its grace time fits in, and is dead when it comes, whether or not anybody can be asked.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from enum import Enum

from metaros.limits import LIMITS

__all__ = ["KILL_BEFORE_S", "MOST_S", "Lease", "LeaseAction", "Leases"]

KILL_BEFORE_S = 0.15  # SIGKILL and the kernel's work are done by the end
MARGIN_S = 0.1  # between the end of the grace time and SIGKILL
GRACE_SHARE = 0.3  # of a lease: the most that a stop in good order may take of it
MOST_S = LIMITS.node_lease_s  # the longest lease that is believed


class LeaseAction(Enum):
    """What a lease asks for now."""

    RUN = "run"
    STOP = "stop"  # in good order
    KILL = "kill"


@dataclass(frozen=True, slots=True)
class Lease:
    """The right to run a node until `until_s`."""

    lease_id: str
    until_s: float
    valid_s: float  # what it was given for
    taken_back: bool = False  # to be stopped now, and dead by its end
    epoch: int = 0  # the fencing number, told to the node

    def stop_at_s(self, grace_s: float) -> float:
        """When to ask the node to stop, if the lease is not renewed; `grace_s` is the node's own grace time."""
        return self.kill_at_s - self.grace_s(grace_s) - MARGIN_S

    def grace_s(self, grace_s: float) -> float:
        """The grace time that fits into the lease."""
        return min(grace_s, GRACE_SHARE * self.valid_s)

    @property
    def kill_at_s(self) -> float:
        """When to kill it."""
        return self.until_s - KILL_BEFORE_S


class Leases:
    """The leases that are held; time is an argument."""

    def __init__(self) -> None:
        self._held: dict[str, Lease] = {}
        self._given_at_s = float("-inf")

    def __len__(self) -> int:
        return len(self._held)

    def get(self, node: str) -> Lease | None:
        """Its lease, over or not."""
        return self._held.get(node)

    def replace(
        self,
        given: Iterable[tuple[str, str, float]],
        *,
        age_s: float,
        now_s: float,
        epochs: Mapping[str, int] | None = None,
    ) -> None:
        """Take (node, lease id, seconds) for all that are held; the rest is taken back. They were given `age_s` ago:
        words that are older than the last ones, and come late, change nothing.
        """
        given_at_s = now_s - max(age_s, 0.0)
        if given_at_s < self._given_at_s:
            return
        self._given_at_s = given_at_s
        held: dict[str, Lease] = {}
        for node, lease_id, valid_s in given:
            valid_s = min(max(valid_s, 0.0), MOST_S)
            held[node] = Lease(lease_id, given_at_s + valid_s, valid_s, epoch=(epochs or {}).get(node, 0))
        for node, lease in self._held.items():  # taken back: stop now, dead by its old end
            if node not in held and lease.until_s > now_s:
                held[node] = replace(lease, taken_back=True)
        self._held = held

    def duty(self, node: str, grace_s: float, now_s: float) -> LeaseAction:
        """What a node has to do."""
        lease = self._held.get(node)
        if lease is None or now_s >= lease.kill_at_s:
            return LeaseAction.KILL
        return LeaseAction.STOP if lease.taken_back or now_s >= lease.stop_at_s(grace_s) else LeaseAction.RUN

    def next_s(self, graces: Mapping[str, float], now_s: float) -> float | None:
        """When a duty of one of these nodes changes next; None when none does."""
        times = []
        for node, grace_s in graces.items():
            if (lease := self._held.get(node)) is not None:
                times += [at for at in (lease.stop_at_s(grace_s), lease.kill_at_s) if at > now_s]
        return min(times, default=None)
