"""When to renew the certificate: a pure schedule over its validity, the wall clock and past failures.

Two thirds of its life after it began, give or take a twentieth of it, so that a fleet enrolled in one hour does not
renew in one hour. An attempt that failed is made again, ever more slowly. A robot that was off for too long goes on
trying in the time of grace, in which the gateway still renews; after that only a new token helps.
"""

from __future__ import annotations

import random  # noqa: TID251 - the type only; the generator is an argument
from typing import Literal

from edge_agent.identity.certificate import Validity
from metaros.clock import Clock

__all__ = ["GRACE_S", "Renewal", "RenewalState"]

RenewalState = Literal["fresh", "due", "grace", "over"]

GRACE_S = 30 * 86_400.0  # how long after its end a certificate still renews itself
JITTER = 0.05
FIRST_AGAIN_S, MOST_AGAIN_S = 30.0, 3600.0
LOOK_S = 60.0  # the longest wait: the calendar may be set meanwhile
NS = 1_000_000_000


class Renewal:
    """The rule for one certificate after the other; reads the clock, does nothing itself."""

    def __init__(self, validity: Validity, clock: Clock, rng: random.Random) -> None:
        self._clock = clock
        self._rng = rng
        self._failures = 0
        self._again_s = 0.0  # monotonic
        self.renewed(validity)

    @property
    def state(self) -> RenewalState:
        """How the certificate stands now, by the wall clock."""
        now_ns = self._clock.wall_ns()
        if now_ns >= self._validity.not_after_ns + round(GRACE_S * NS):
            return "over"
        if now_ns >= self._validity.not_after_ns:
            return "grace"
        return "due" if now_ns >= self._due_ns else "fresh"

    def wait_s(self) -> float:
        """Seconds until it is worth looking again; 0 = renew now."""
        state = self.state
        if state in ("due", "grace", "over"):
            return min(max(0.0, self._again_s - self._clock.monotonic_s()), LOOK_S)
        return min((self._due_ns - self._clock.wall_ns()) / NS, LOOK_S)

    def may_ask(self) -> bool:
        """Whether an attempt may be made now, the rule aside: the last failure is long enough ago."""
        return self._clock.monotonic_s() >= self._again_s

    def renewed(self, validity: Validity) -> None:
        """There is a new certificate."""
        life_ns = max(0, validity.not_after_ns - validity.not_before_ns)
        share = 2.0 / 3.0 + JITTER * (2.0 * self._rng.random() - 1.0)
        self._validity = validity
        self._due_ns = validity.not_before_ns + round(life_ns * share)
        self._first_again_s = min(FIRST_AGAIN_S, life_ns / NS / 100)
        self._failures = 0
        self._again_s = 0.0

    def failed(self) -> None:
        """An attempt gave nothing; the next comes later, at most an hour."""
        delay_s = min(self._first_again_s * 2.0 ** min(self._failures, 30), MOST_AGAIN_S)
        self._failures += 1
        self._again_s = self._clock.monotonic_s() + delay_s * (0.8 + 0.4 * self._rng.random())
