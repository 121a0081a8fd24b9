"""When to try again, and when: pure, for both clients and both protocols.

Only what changes nothing, or carries a key by which the gateway knows it again, is tried again: when nobody answered,
or the gateway said that it cannot do it now. Waits double, with full jitter, so that a fleet of programs does not come
back at one moment. A stream that had begun is begun again for minutes: gateways are started anew, and programs that
look at robots outlive them.
"""

from __future__ import annotations

from dataclasses import dataclass
from random import Random  # noqa: TID251  (the type of an argument)

from metaros.clock import Clock
from metaros.errors import MetarosError, RefusedError, UnavailableError

__all__ = ["Retries", "StreamRetries"]

PASSING = (429, 502, 503, 504)
MAX_WAIT_S = 30.0


@dataclass(frozen=True, slots=True)
class Retries:
    """At most `attempts` in all; the first wait is up to `first_s`, and none is over `most_s`.

    A stream that had begun has as many as fit into `stream_s` from its loss on.
    """

    attempts: int = 4
    first_s: float = 0.2
    most_s: float = 5.0
    stream_s: float = 300.0

    def wait_s(
        self, attempt: int, error: MetarosError, *, idempotent: bool, rng: Random, after_s: float | None = None
    ) -> float | None:
        """How long to wait after that attempt (1 is the first) ended so; None: give up.

        `after_s` is what the gateway asks for: that long at least.
        """
        if not idempotent or attempt >= self.attempts or not passing(error):
            return None
        return self.pause_s(attempt, rng, after_s)

    def pause_s(self, attempt: int, rng: Random, after_s: float | None = None) -> float:
        """The wait after that attempt, whether there is one more or not."""
        wait_s = rng.uniform(0.0, min(self.most_s, self.first_s * 2 ** min(attempt - 1, 32)))
        return min(MAX_WAIT_S, wait_s + (after_s or 0.0))


class StreamRetries:
    """The attempts of one stream that only reads."""

    def __init__(self, retries: Retries, *, rng: Random, clock: Clock) -> None:
        self._retries, self._rng, self._clock = retries, rng, clock
        self._attempt = 1
        self._begun = False
        self._until_s = 0.0  # when a stream that was lost is given up

    def went(self) -> None:
        """A reply came."""
        self._attempt, self._begun = 1, True

    def wait_s(self, error: MetarosError) -> float:
        """How long to wait after an attempt ended so; raises the error when there is no further one."""
        now_s, wait_s = self._clock.monotonic_s(), None
        if not self._begun:
            wait_s = self._retries.wait_s(self._attempt, error, idempotent=True, rng=self._rng)
        elif passing(error):
            if self._attempt == 1:
                self._until_s = now_s + self._retries.stream_s
            if now_s < self._until_s:
                wait_s = self._retries.pause_s(self._attempt, self._rng)
        if wait_s is None:
            raise error
        self._attempt += 1
        return wait_s


def passing(error: MetarosError) -> bool:
    """Whether the same may work in a moment."""
    if isinstance(error, RefusedError):
        return error.status in PASSING
    return isinstance(error, UnavailableError)
