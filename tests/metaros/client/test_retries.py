"""When the client tries again: never what could do something twice, and never for ever."""

from __future__ import annotations

from random import Random  # noqa: TID251  (seeded)

import pytest

from metaros.client.retries import MAX_WAIT_S, Retries, StreamRetries
from metaros.clock import ManualClock
from metaros.errors import MetarosError, PeerError, RefusedError, UnavailableError
from tests.support.tables import cases

BUSY = RefusedError("later", status=503, reason="overloaded")


def wait_s(error: MetarosError, attempt: int = 1, **options: object) -> float | None:
    """Of the default policy."""
    chosen = {"idempotent": True, "rng": Random(7), **options}
    return Retries().wait_s(attempt, error, **chosen)  # type: ignore[arg-type]


@cases("error", [BUSY, UnavailableError("nobody"), RefusedError("", status=429)])
def test_what_may_pass_is_tried_again_if_it_may_be_sent_twice(error: MetarosError) -> None:
    assert wait_s(error) is not None
    assert wait_s(error, idempotent=False) is None
    assert wait_s(error, 4) is None, "four attempts are all"


@cases("error", [RefusedError("no", status=404), RefusedError("no", status=500), PeerError("what")])
def test_what_will_not_pass_is_reported_at_once(error: MetarosError) -> None:
    assert wait_s(error) is None


def test_waits_grow_with_jitter_and_heed_the_gateway() -> None:
    rng = Random(1)
    waits = [[wait_s(BUSY, attempt, rng=rng) or 0.0 for _ in range(200)] for attempt in (1, 2, 3)]
    for attempt, found in enumerate(waits):
        assert max(found) <= 0.2 * 2**attempt
        assert min(found) < 0.2 * max(found), "full jitter: from nothing"
    assert (wait_s(BUSY, after_s=3.0) or 0.0) >= 3.0
    assert wait_s(BUSY, after_s=3600.0) == MAX_WAIT_S


def test_a_stream_that_had_begun_is_begun_again_for_minutes() -> None:
    clock = ManualClock()
    tries = StreamRetries(Retries(attempts=2, stream_s=60.0), rng=Random(1), clock=clock)
    tries.wait_s(BUSY)
    with pytest.raises(RefusedError):
        tries.wait_s(BUSY)  # it never went
    for _ in range(2):  # each loss has its own time
        tries.went()
        for _ in range(59):
            assert tries.wait_s(UnavailableError("nobody")) <= 5.0
            clock.advance(1.0)
        clock.advance(1.0)
        with pytest.raises(UnavailableError):
            tries.wait_s(UnavailableError("nobody"))
    tries.went()
    with pytest.raises(RefusedError):
        tries.wait_s(RefusedError("no", status=403))
