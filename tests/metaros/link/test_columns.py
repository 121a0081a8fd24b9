"""Columns: what goes in comes out; garbage is a FrameError."""

from __future__ import annotations

import contextlib

import numpy as np
import pytest
from google.protobuf.message import DecodeError
from hypothesis import given, settings
from hypothesis import strategies as st

from metaros._proto import link_pb2
from metaros.errors import FrameError
from metaros.limits import Limits
from metaros.link import Reassembler, pack_batch, pack_metrics, unpack_batch, unpack_metrics

STAMPS = st.integers(min_value=-(2**63), max_value=2**63 - 1)


@settings(max_examples=50)
@given(st.lists(st.tuples(STAMPS, st.binary(max_size=50)), min_size=1, max_size=40), st.integers(1, 2**62))
def test_samples_round_trip(samples: list[tuple[int, bytes]], first_seq: int) -> None:
    frame = pack_batch(3, 77, first_seq, [stamp for stamp, _ in samples], [payload for _, payload in samples])
    columns = unpack_batch(link_pb2.Batch.FromString(frame.SerializeToString()))
    assert (columns.stream_id, columns.epoch, columns.count) == (3, 77, len(samples))
    assert columns.last_seq == first_seq + len(samples) - 1
    assert [(stamp, bytes(payload)) for _, stamp, payload in columns.samples()] == samples
    assert [seq for seq, _, _ in columns.samples()] == list(range(first_seq, columns.last_seq + 1))


@settings(max_examples=50)
@given(st.lists(st.tuples(st.integers(1, 2**32 - 1), STAMPS, st.floats(width=64)), min_size=1, max_size=40))
def test_metrics_round_trip(rows: list[tuple[int, int, float]]) -> None:
    series, stamps, values = zip(*rows, strict=True)
    columns = unpack_metrics(pack_metrics(5, 9, series, stamps, values))
    assert columns.series_ids.tolist() == list(series)
    assert columns.stamps_ns.tolist() == list(stamps)
    np.testing.assert_array_equal(columns.values, np.array(values))
    assert (columns.epoch, columns.count, columns.last_seq) == (5, len(rows), 8 + len(rows))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"count": 0}, "holds 1 to"),
        ({"count": 5000}, "holds 1 to"),
        ({"first_seq": 0}, "out of range"),
        ({"first_seq": 2**64 - 1}, "out of range"),
        ({"stream_id": 0}, "stream 0"),
        ({"stamps": b"12345678"}, "column stamps"),
        ({"lengths": b"1234"}, "column lengths"),
        ({"payload": b"abcd"}, "add up"),
        ({"payload": b""}, "add up"),
        ({"chunk_count": 2}, "chunk"),
    ],
)
def test_a_broken_batch_is_refused(change: dict[str, object], words: str) -> None:
    frame = pack_batch(1, 1, 1, [1, 2], [b"ab", b"c"])
    for name, value in change.items():
        setattr(frame, name, value)
    with pytest.raises(FrameError, match=words):
        unpack_batch(frame)


def test_a_batch_over_the_limit_is_refused_but_one_large_sample_is_not() -> None:
    limits = Limits(batch_bytes=100, sample_bytes=1000)
    with pytest.raises(FrameError, match="over the limit"):
        unpack_batch(pack_batch(1, 1, 1, [1, 2], [bytes(60), bytes(60)]), limits=limits)
    assert unpack_batch(pack_batch(1, 1, 1, [1], [bytes(1000)]), limits=limits).count == 1
    with pytest.raises(FrameError, match="over the limit"):
        unpack_batch(pack_batch(1, 1, 1, [1], [bytes(1001)]), limits=limits)


def test_columns_of_different_length_cannot_be_packed() -> None:
    with pytest.raises(FrameError, match="2 stamps for 1"):
        pack_batch(1, 1, 1, [1, 2], [b""])
    with pytest.raises(FrameError, match="columns differ"):
        pack_metrics(1, 1, [1], [1, 2], [1.0])


def test_metrics_on_a_stream_of_samples_are_refused() -> None:
    frame = pack_metrics(1, 1, [1], [1], [1.0])
    frame.stream_id = 7
    with pytest.raises(FrameError, match="stream 7 carries samples, not metrics"):
        unpack_metrics(frame)


def test_series_zero_is_refused() -> None:
    with pytest.raises(FrameError, match="series ids"):
        unpack_metrics(pack_metrics(1, 1, [1, 0], [1, 2], [1.0, 2.0]))


@settings(max_examples=50)
@given(st.binary(max_size=200))
def test_garbage_is_a_frame_error_or_fine(data: bytes) -> None:
    try:
        frame = link_pb2.AgentFrame.FromString(data)
    except DecodeError:
        return
    reassembler = Reassembler()
    for batch in frame.batches.batches:
        try:
            columns = reassembler.feed(batch)
        except FrameError:
            continue
        assert columns is None or len(list(columns.samples())) == columns.count
    with contextlib.suppress(FrameError):
        unpack_metrics(frame.metrics)
