"""Runs that lie across each other come out as messages in order, however little may be held."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gateway.history.messages import merged
from gateway.store.telemetry.samples import StoredBatch, StoredRun
from tests.gateway.store.samples import channel

CHANNEL = channel()
RUNS = st.lists(
    st.tuples(
        st.integers(1, 3), st.lists(st.tuples(st.integers(0, 50), st.binary(max_size=30)), min_size=1, max_size=8)
    ),
    max_size=12,
)
Content = list[tuple[int, list[tuple[int, bytes]]]]


def stored(content: Content) -> dict[StoredRun, StoredBatch]:
    """Runs with their batches; each stream's numbers go on from run to run."""
    numbers = {1: 1, 2: 1, 3: 1}
    made = {}
    for stream_id, samples in content:
        first_seq = numbers[stream_id]
        numbers[stream_id] += len(samples)
        stamps = np.array([stamp for stamp, _ in samples], np.int64)
        lengths = np.array([len(payload) for _, payload in samples], np.uint32)
        payload = b"".join(payload for _, payload in samples)
        run = StoredRun(
            channel=CHANNEL,
            stream_id=stream_id,
            epoch=9,
            first_seq=first_seq,
            count=len(samples),
            first_ns=int(stamps.min()),
            last_ns=int(stamps.max()),
            receive_ns=5,
            stored_ns=6,
            size_bytes=len(payload),
        )
        made[run] = StoredBatch(CHANNEL, stream_id, 9, first_seq, 5, 6, stamps, lengths, payload)
    return made


@settings(max_examples=30)
@given(RUNS, st.integers(0, 50), st.integers(0, 50), st.booleans(), st.sampled_from([0, 40, 1 << 20]))
def test_messages_come_in_order(content: Content, low: int, high: int, newest_first: bool, hold_bytes: int) -> None:
    made = stored(content)
    expected = sorted(
        (stamp_ns, run.stream_id, 9, seq, payload)
        for run, batch in made.items()
        for seq, stamp_ns, payload in batch.samples()
        if low <= stamp_ns <= high
    )
    if newest_first:
        expected.reverse()
    runs = sorted(made, key=lambda run: run.key(newest_first=newest_first), reverse=newest_first)
    found = merged(runs, made.__getitem__, start_ns=low, end_ns=high, newest_first=newest_first, hold_bytes=hold_bytes)
    assert [(*message.place, message.payload) for message in found] == expected


def test_a_run_that_cannot_be_loaded_is_left_out() -> None:
    made = stored([(1, [(1, b"a"), (5, b"b")]), (2, [(2, b"c"), (4, b"d")])])
    lost = next(iter(made))
    found = merged(
        sorted(made, key=StoredRun.key), lambda run: None if run == lost else made[run], start_ns=0, end_ns=9
    )
    assert [message.payload for message in found] == [b"c", b"d"]


@pytest.mark.parametrize(("hold_bytes", "loads"), [(1 << 20, 3), (25_000, 6)])
def test_what_is_needed_last_is_forgotten_and_loaded_again(hold_bytes: int, loads: int) -> None:
    """Three runs of 10 kB over the same time: with room for two, the third waits without its payloads."""
    made = stored([(stream, [(stamp, bytes(5000)) for stamp in (stream, 10 + stream)]) for stream in (1, 2, 3)])
    count = 0

    def load(run: StoredRun) -> StoredBatch:
        nonlocal count
        count += 1
        return made[run]

    found = list(merged(sorted(made, key=StoredRun.key), load, start_ns=0, end_ns=99, hold_bytes=hold_bytes))
    assert [message.stamp_ns for message in found] == [1, 2, 3, 11, 12, 13]
    assert 3 <= count <= loads
    assert (count == 3) == (hold_bytes > 30_000)
