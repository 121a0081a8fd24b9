"""When the client tries again: never what could do something twice, and never for ever."""

from __future__ import annotations

from random import Random  # noqa: TID251  (seeded)

import pytest

from metaros.client.retries import MAX_WAIT_S, Retries
from metaros.errors import MetarosError, PeerError, RefusedError, UnavailableError

BUSY = RefusedError("later", status=503, reason="overloaded")


def wait_s(error: MetarosError, attempt: int = 1, **options: object) -> float | None:
    """Of the default policy."""
    chosen = {"idempotent": True, "rng": Random(7), **options}
    return Retries().wait_s(attempt, error, **chosen)  # type: ignore[arg-type]


@pytest.mark.parametrize("error", [BUSY, UnavailableError("nobody"), RefusedError("", status=429)])
def test_what_may_pass_is_tried_again_if_it_may_be_sent_twice(error: MetarosError) -> None:
    assert wait_s(error) is not None
    assert wait_s(error, idempotent=False) is None
    assert wait_s(error, 4) is None, "four attempts are all"


@pytest.mark.parametrize("error", [RefusedError("no", status=404), RefusedError("no", status=500), PeerError("what")])
def test_what_will_not_pass_is_told_at_once(error: MetarosError) -> None:
    assert wait_s(error) is None


def test_waits_grow_with_jitter_and_heed_the_gateway() -> None:
    rng = Random(1)
    waits = [[wait_s(BUSY, attempt, rng=rng) or 0.0 for _ in range(200)] for attempt in (1, 2, 3)]
    for attempt, found in enumerate(waits):
        assert max(found) <= 0.2 * 2**attempt
        assert min(found) < 0.2 * max(found), "full jitter: from nothing"
    assert (wait_s(BUSY, after_s=3.0) or 0.0) >= 3.0
    assert wait_s(BUSY, after_s=3600.0) == MAX_WAIT_S
