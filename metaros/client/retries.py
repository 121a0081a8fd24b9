"""When to try again, and when: pure, for both clients and both protocols.

Only what changes nothing, or carries a key by which the gateway knows it again, is tried again: when nobody answered,
or the gateway said that it cannot do it now. Waits double, with full jitter, so that a fleet of programs does not come
back at one moment.
"""

from __future__ import annotations

from dataclasses import dataclass
from random import Random  # noqa: TID251  (the type of an argument)

from metaros.errors import MetarosError, RefusedError, UnavailableError

__all__ = ["Retries"]

PASSING = (429, 502, 503, 504)
MAX_WAIT_S = 30.0


@dataclass(frozen=True, slots=True)
class Retries:
    """At most `attempts` in all; the first wait is up to `first_s`, and none is over `most_s`."""

    attempts: int = 4
    first_s: float = 0.2
    most_s: float = 5.0

    def wait_s(
        self, attempt: int, error: MetarosError, *, idempotent: bool, rng: Random, after_s: float | None = None
    ) -> float | None:
        """How long to wait after that attempt (1 is the first) ended so; None: give up.

        `after_s` is what the gateway asks for: that long at least.
        """
        if not idempotent or attempt >= self.attempts or not passing(error):
            return None
        wait_s = rng.uniform(0.0, min(self.most_s, self.first_s * 2 ** (attempt - 1)))
        return min(MAX_WAIT_S, wait_s + (after_s or 0.0))


def passing(error: MetarosError) -> bool:
    """Whether the same may work in a moment."""
    if isinstance(error, RefusedError):
        return error.status in PASSING
    return isinstance(error, UnavailableError)
