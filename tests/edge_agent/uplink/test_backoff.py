"""Back-off: doubling, capped, jittered, reset."""

from __future__ import annotations

import random  # noqa: TID251 - seeded

import pytest

from edge_agent.uplink.backoff import Backoff


def test_doubles_to_the_cap_and_starts_again() -> None:
    backoff = Backoff(random.Random(1), jitter=0.0)
    assert [backoff.next_s() for _ in range(6)] == pytest.approx([0.1, 0.2, 0.4, 0.8, 1.0, 1.0])
    backoff.reset()
    assert backoff.next_s() == pytest.approx(0.1)


def test_jitter_stays_within_a_fifth() -> None:
    backoff = Backoff(random.Random(2))
    delays = [backoff.next_s() for _ in range(2000)][10:]
    assert min(delays) >= 0.8
    assert max(delays) <= 1.2
    assert max(delays) - min(delays) > 0.3
