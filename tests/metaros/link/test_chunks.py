"""Large samples travel in pieces and come out whole, or not at all."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from metaros._proto import link_pb2
from metaros.errors import FrameError
from metaros.limits import Limits
from metaros.link import Reassembler, pack_batch, split_sample

SMALL = Limits(batch_bytes=16, chunk_bytes=10, sample_bytes=100)


def pieces(payload: bytes, *, stream: int = 1, seq: int = 1) -> list[link_pb2.Batch]:
    return list(split_sample(stream, 7, seq, 123, payload, limits=SMALL))


@given(st.binary(max_size=100))
def test_a_sample_of_any_size_survives(payload: bytes) -> None:
    reassembler = Reassembler(limits=SMALL)
    results = [reassembler.feed(piece) for piece in pieces(payload)]
    assert all(result is None for result in results[:-1])
    columns = results[-1]
    assert columns is not None
    assert [(seq, stamp, bytes(data)) for seq, stamp, data in columns.samples()] == [(1, 123, payload)]
    assert reassembler.pending_bytes == 0


def test_pieces_of_two_streams_may_interleave() -> None:
    reassembler = Reassembler(limits=SMALL)
    first, second = pieces(bytes(range(30)), stream=1), pieces(bytes(range(50, 80)), stream=2)
    done = [reassembler.feed(piece) for pair in zip(first, second, strict=True) for piece in pair]
    assert [None if columns is None else columns.payload for columns in done[-2:]] == [
        bytes(range(30)),
        bytes(range(50, 80)),
    ]


def test_whole_batches_pass_through() -> None:
    columns = Reassembler(limits=SMALL).feed(pack_batch(1, 1, 1, [1, 2], [b"a", b"b"]))
    assert columns is not None
    assert columns.count == 2


@pytest.mark.parametrize("order", [[1], [0, 2], [0, 0], [0, 1, 1]])
def test_pieces_out_of_order_are_refused(order: list[int]) -> None:
    reassembler = Reassembler(limits=SMALL)
    parts = pieces(bytes(30))
    for index in order[:-1]:
        reassembler.feed(parts[index])
    with pytest.raises(FrameError, match="out of order"):
        reassembler.feed(parts[order[-1]])


def test_a_batch_between_pieces_is_refused() -> None:
    reassembler = Reassembler(limits=SMALL)
    reassembler.feed(pieces(bytes(30))[0])
    with pytest.raises(FrameError, match="in the middle"):
        reassembler.feed(pack_batch(1, 7, 2, [1], [b"x"]))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"stream_id": 0}, "stream 0"),
        ({"count": 2}, "exactly one"),
        ({"lengths": (101).to_bytes(4, "little")}, "over the limit"),
        ({"payload": b""}, "1 to 10 bytes"),
        ({"payload": bytes(11)}, "1 to 10 bytes"),
    ],
)
def test_a_broken_first_piece_is_refused(change: dict[str, object], words: str) -> None:
    piece = pieces(bytes(30))[0]
    for name, value in change.items():
        setattr(piece, name, value)
    with pytest.raises(FrameError, match=words):
        Reassembler(limits=SMALL).feed(piece)


def test_pieces_that_lie_about_the_size_are_refused() -> None:
    reassembler = Reassembler(limits=SMALL)
    first, second, third = pieces(bytes(30))
    reassembler.feed(first)
    second.lengths = (31).to_bytes(4, "little")
    with pytest.raises(FrameError, match="disagree"):
        reassembler.feed(second)
    second.lengths = (30).to_bytes(4, "little")
    reassembler.feed(second)
    third.payload = b"short"
    with pytest.raises(FrameError, match="make 25 bytes"):
        reassembler.feed(third)


def test_incomplete_samples_are_bounded() -> None:
    reassembler = Reassembler(max_bytes=50, limits=SMALL)
    reassembler.feed(pieces(bytes(30), stream=1)[0])
    with pytest.raises(FrameError, match="incomplete"):
        reassembler.feed(pieces(bytes(30), stream=2)[0])
