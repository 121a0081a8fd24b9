"""The robot's byte budget as an operator set it: in force at once, kept over restarts; the twin's goes before it."""

from __future__ import annotations

import asyncio
import json

from edge_agent.errors import TwinRulesError
from edge_agent.link.budget import Budget
from edge_agent.outbox import Disk
from metaros.clock import Clock
from metaros.errors import UsageError
from metaros.limits import LIMITS

__all__ = ["UplinkLimit", "stored_limit"]

_NAME = "uplink.json"
_MAX_BYTES = 1024


def stored_limit(disk: Disk) -> int:
    """The budget that was kept, in bytes a second; 0, no limit, where there is none. Raises DiskError."""
    size = min(disk.size(_NAME), _MAX_BYTES)
    try:
        stored = json.loads(disk.read(_NAME, 0, size))["bytes_per_s"] if size else 0
        return max(0, int(stored))
    except (ValueError, KeyError, TypeError, OverflowError, RecursionError):
        return 0


class UplinkLimit:
    """Sets the budget's limit and keeps it in the state directory."""

    def __init__(self, disk: Disk, budget: Budget, clock: Clock) -> None:
        self._disk = disk
        self._budget = budget
        self._clock = clock
        self._own = budget.limit_bytes_per_s
        self._twin: int | None = None
        self._turn = asyncio.Lock()

    @property
    def bytes_per_s(self) -> int:
        """The limit that is in force; 0 for none."""
        return self._own if self._twin is None else self._twin

    def rule(self, bytes_per_s: int | None) -> None:
        """The twin's limit, 0 for none; None where it says nothing, and the one that was set and kept holds again."""
        if bytes_per_s != self._twin:
            self._twin = bytes_per_s
            self._budget.set_limit(self.bytes_per_s, self._clock.monotonic_s())

    async def set(self, bytes_per_s: int) -> None:
        """Another limit from now on, 0 for none.

        Raises:
            UsageError: less than an agent can work with.
            TwinRulesError: the robot's twin says what the limit is.
            DiskError: it could not be kept: it is in force until the agent ends.
        """
        if 0 < bytes_per_s < LIMITS.uplink_least_bytes_per_s:
            raise UsageError(f"{bytes_per_s} bytes/s is below the least of {LIMITS.uplink_least_bytes_per_s}")
        if self._twin is not None:
            raise TwinRulesError(f"the robot's twin sets its budget ({self._twin} bytes/s): change it there")
        self._own = bytes_per_s
        self._budget.set_limit(bytes_per_s, self._clock.monotonic_s())
        async with self._turn:
            text = json.dumps({"bytes_per_s": self._own})  # the newest, whoever comes last
            await asyncio.to_thread(self._disk.replace, _NAME, text.encode())
