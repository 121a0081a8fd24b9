"""Segments as files: any batches in any order come back as they were, and other programs read them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from gateway.errors import CorruptObjectError
from gateway.store.telemetry import segments
from gateway.store.telemetry.samples import StoredBatch
from gateway.store.telemetry.segment_records import Messages, pack_records
from gateway.store.telemetry.segments import RUN_NS, Packed, Segment, open_chunk, pack, unpack
from tests.gateway.store.samples import channel

Made = tuple[int, int, list[bytes], int]
BATCHES = st.lists(
    st.tuples(
        st.integers(0, 2),
        st.integers(0, 1),
        st.lists(st.binary(max_size=40), min_size=1, max_size=4),
        st.integers(0, 3),
    ),
    min_size=1,
    max_size=20,
)


def batch(stream_id: int, epoch: int, first_seq: int, payloads: list[bytes], stamp_ns: int) -> Packed:
    """Samples a nanosecond apart; the stream's channel has the number of the stream."""
    lengths = np.array([len(item) for item in payloads], np.uint32)
    stamps = np.arange(stamp_ns, stamp_ns + len(payloads), dtype=np.int64)
    topic = replace(channel(topic=f"/t{stream_id}"), channel_id=stream_id)
    return Packed(stream_id, StoredBatch(topic, stream_id, epoch, first_seq, 5, 6, stamps, lengths, b"".join(payloads)))


def samples(segment: Segment) -> dict[tuple[int, int, int], tuple[int, bytes]]:
    """Every sample by (stream, epoch, number), read through the index."""
    found = {}
    for run in segment.runs:
        records = open_chunk(segment.data[run.chunk_start : run.chunk_start + run.chunk_bytes])
        stamps, lengths, payload = unpack(records, offset=run.offset, first_seq=run.first_seq, count=run.count)
        assert (int(stamps.min()), int(stamps.max()), len(payload)) == (run.first_ns, run.last_ns, run.size_bytes)
        end = 0
        for place, length in enumerate(lengths.tolist()):
            end += length
            key = (run.stream_id, run.epoch, run.first_seq + place)
            assert key not in found
            found[key] = (int(stamps[place]), payload[end - length : end])
    return found


@given(BATCHES, st.randoms(use_true_random=False), st.integers(100, 5000))
@settings(max_examples=30)
def test_whatever_is_packed_comes_back(made: list[Made], rng: object, chunk_bytes: int) -> None:
    numbers: dict[tuple[int, int], int] = {}
    items, expected = [], {}
    for stream_id, epoch, payloads, skip in made:
        first = numbers.get((stream_id, epoch), 2**32 - 5) + skip  # numbers past 32 bits, with holes
        items.append(batch(stream_id, epoch, first, payloads, first))
        numbers[stream_id, epoch] = first + len(payloads)
        for place, data in enumerate(payloads):
            expected[stream_id, epoch, first + place] = (first + place, data)
    rng.shuffle(items)  # type: ignore[attr-defined]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(segments, "CHUNK_BYTES", chunk_bytes)
        segment = pack(items, robot_id="r1")
    assert samples(segment) == expected
    assert segment.messages == len(expected)
    edges = (min(stamp for stamp, _ in expected.values()), max(stamp for stamp, _ in expected.values()))
    assert (segment.first_ns, segment.last_ns, segment.stored_ns) == (*edges, 6)


def test_batches_that_follow_are_one_run_and_others_are_not() -> None:
    items = [batch(1, 1, 1, [b"a"], 1), batch(1, 1, 2, [b"b"], 2), batch(1, 1, 4, [b"d"], 4), batch(1, 2, 5, [b"e"], 5)]
    runs = pack(items, robot_id="r1").runs
    assert [(run.epoch, run.first_seq, run.count) for run in runs] == [(1, 1, 2), (1, 4, 1), (2, 5, 1)]
    jump = [batch(1, 1, 1, [b"a"], 1), batch(1, 1, 2, [b"b"], 2 + RUN_NS), batch(1, 1, 3, [b"c"], 1)]
    assert [run.count for run in pack(jump, robot_id="r1").runs] == [1, 1, 1]


def test_what_is_packed_wrong_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    def other(channel_id: int, packed: Messages) -> tuple[bytes, np.ndarray[tuple[int], np.dtype[np.int64]]]:
        records, offsets = pack_records(channel_id, packed)
        return records.replace(b"x", b"y"), offsets

    monkeypatch.setattr(segments, "pack_records", other)
    pack([batch(1, 1, 1, [b"a"], 1)], robot_id="r1")
    with pytest.raises(CorruptObjectError, match="packed wrong"):
        pack([batch(1, 1, 1, [b"a", b"x"], 1)], robot_id="r1")


def test_rosbags_reads_a_segment(tmp_path: Path) -> None:
    types = get_typestore(Stores.ROS2_JAZZY)
    texts = [f"number {number}" for number in range(100)]
    string = types.types["std_msgs/msg/String"]
    payloads = [bytes(types.serialize_cdr(string(data=text), "std_msgs/msg/String")) for text in texts]
    items = [
        batch(stream_id, 1, 1 + 10 * n, payloads[10 * n : 10 * n + 10], 10 * n)
        for stream_id in (1, 2)
        for n in range(10)
    ]
    path = tmp_path / "segment.mcap"
    path.write_bytes(pack(items, robot_id="r1").data)
    with AnyReader([path]) as reader:
        assert {connection.topic for connection in reader.connections} == {"/t1", "/t2"}
        wanted = [connection for connection in reader.connections if connection.topic == "/t2"]
        found = [
            (stamp_ns, reader.deserialize(data, connection.msgtype).data)  # type: ignore[attr-defined]
            for connection, stamp_ns, data in reader.messages(wanted)
        ]
    assert found == list(enumerate(texts))
