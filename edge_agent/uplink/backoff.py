"""How long to wait before the next attempt: doubling from a first delay to a cap, with jitter. Pure."""

from __future__ import annotations

import random  # noqa: TID251 - the type only; the generator is an argument

__all__ = ["Backoff"]


class Backoff:
    """0.1 s x 2^n up to 1 s, each plus or minus a fifth, so that a fleet does not return in one instant."""

    def __init__(self, rng: random.Random, *, first_s: float = 0.1, cap_s: float = 1.0, jitter: float = 0.2) -> None:
        self._rng = rng
        self._first_s = first_s
        self._cap_s = cap_s
        self._jitter = jitter
        self._failures = 0

    def next_s(self) -> float:
        """The delay after one more failure."""
        delay_s = min(self._first_s * 2.0 ** min(self._failures, 30), self._cap_s)
        self._failures += 1
        return delay_s * (1.0 + self._jitter * (2.0 * self._rng.random() - 1.0))

    def reset(self) -> None:
        """An attempt succeeded."""
        self._failures = 0
