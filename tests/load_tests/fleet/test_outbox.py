"""The simulated robot's outbox: numbers, resends, back-fill and declared losses as a real one has them."""

from __future__ import annotations

import pytest

from edge_agent.errors import BehindError
from edge_agent.outbox import Frame, Kind
from load_tests.fleet.outbox import MemoryOutbox
from metaros.link import BACKFILL_BIT

EPOCH = 7


class Rig:
    """An outbox and what it was told to be stored."""

    def __init__(self, *, quota_bytes: int = 10_000) -> None:
        self.stored: list[Frame] = []
        self.outbox = MemoryOutbox(epoch=EPOCH, writer="w", quota_bytes=quota_bytes, on_stored=self.stored.append)
        self.outbox.online = True

    def put(self, count: int = 1, *, size: int = 10) -> int:
        """Hand over a run of samples; its first number."""
        return self.outbox.append("bulk", 1, Kind.SAMPLES, count, bytes(size), now_ns=1)

    def taken(self, name: str = "bulk") -> list[int]:
        """The first numbers of all that can be sent now."""
        found = []
        while (taken := self.outbox.take(name)) is not None:
            found.append(taken.frame.first_seq)
        return found


def test_runs_are_numbered_without_holes_and_sent_once() -> None:
    rig = Rig()
    assert [rig.put(3), rig.put(2), rig.put()] == [1, 4, 6]
    assert rig.taken() == [1, 4, 6]
    assert rig.taken() == []
    rig.outbox.acknowledge(1, EPOCH, 5)
    assert [frame.first_seq for frame in rig.stored] == [1, 4]
    assert rig.outbox.waiting == 1


def test_a_new_session_sends_again_what_is_beyond_the_watermark() -> None:
    rig = Rig()
    for _ in range(4):
        rig.put()
    rig.taken()
    rig.outbox.resume({(EPOCH, 1): 2})
    assert [frame.first_seq for frame in rig.stored] == [1, 2]
    assert rig.taken() == [3, 4]
    rig.outbox.restart(("bulk",))
    assert rig.taken() == [3, 4]


def test_a_gateway_that_has_more_than_was_given_is_refused() -> None:
    rig = Rig()
    rig.put()
    with pytest.raises(BehindError):
        rig.outbox.resume({(EPOCH, 1): 2})


def test_what_comes_without_a_link_is_a_stream_of_its_own() -> None:
    rig = Rig()
    rig.put()
    rig.outbox.online = False
    assert rig.put() == 1
    late = rig.outbox.ranges(("bulk_backfill",))
    assert [(held.stream_id, held.first_seq, held.last_seq) for held in late] == [(1 | BACKFILL_BIT, 1, 1)]
    assert rig.taken("bulk_backfill") == [1]


def test_over_the_quota_samples_become_one_declared_loss() -> None:
    rig = Rig(quota_bytes=300)
    rig.put(size=250)
    rig.put(2, size=250)
    rig.put(3, size=250)
    frames = [taken.frame for taken in iter(lambda: rig.outbox.take("bulk"), None)]
    assert [frame.kind for frame in frames] == [Kind.SAMPLES, Kind.GAP]
    assert (frames[1].gap().from_seq, frames[1].gap().to_seq, frames[1].gap().reason) == (2, 6, "outbox_full")
    assert rig.outbox.lost["bulk"] == 5
    rig.outbox.acknowledge(1, EPOCH, 6)
    assert rig.outbox.waiting == 0
