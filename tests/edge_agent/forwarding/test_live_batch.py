"""Batches: when live samples go, and that they hold what was put in."""

from __future__ import annotations

import pytest

from edge_agent.forwarding.live_batch import Linger, sample_batches
from edge_agent.forwarding.live_queue import LiveSample
from metaros.limits import Limits
from metaros.link import Reassembler, unpack_batch


def test_linger_waits_for_time_or_size() -> None:
    linger = Linger(linger_s=0.005, flush_bytes=100)
    assert linger.wait_s(1.0) is None
    linger.add(10, 1.0)
    linger.add(10, 1.004)
    assert linger.wait_s(1.001) == pytest.approx(0.004)
    assert linger.wait_s(1.005) == 0.0
    linger.flushed()
    assert linger.wait_s(2.0) is None
    linger.add(100, 2.0)
    assert linger.wait_s(2.0) == 0.0


def test_holes_split_a_run() -> None:
    samples = [LiveSample(seq, seq * 10, bytes([seq])) for seq in (3, 4, 7, 9, 10)]
    batches = [unpack_batch(batch) for batch in sample_batches(5, 1, samples)]
    assert [(batch.first_seq, batch.count) for batch in batches] == [(3, 2), (7, 1), (9, 2)]
    rows = [row for batch in batches for row in batch.samples()]
    assert [(seq, stamp, bytes(data)) for seq, stamp, data in rows] == [tuple(sample) for sample in samples]


def test_a_large_sample_becomes_pieces() -> None:
    limits = Limits(batch_bytes=100, chunk_bytes=100)
    batches = list(sample_batches(5, 1, [LiveSample(1, 0, bytes(250))], limits=limits))
    assert [batch.chunk_count for batch in batches] == [3, 3, 3]
    whole = [Reassembler(limits=limits)]
    columns = [whole[0].feed(batch) for batch in batches][-1]
    assert columns is not None
    assert columns.payload == bytes(250)


def test_nothing_makes_no_batch() -> None:
    assert list(sample_batches(5, 1, [])) == []
