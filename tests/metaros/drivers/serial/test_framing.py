"""Frames: what goes in comes out, whatever is between them; garbage is skipped, counted and bounded."""

from __future__ import annotations

import binascii
import random  # noqa: TID251 - seeded
from collections import Counter

import pytest
from cobs import cobs
from hypothesis import given
from hypothesis import strategies as st

from metaros.drivers.serial.framing import Frame, FrameSplitter, encode_frame


def splitter(max_bytes: int = 4096) -> tuple[FrameSplitter, Counter[str]]:
    counts: Counter[str] = Counter()
    return FrameSplitter(max_bytes=max_bytes, count=lambda name: counts.update([name])), counts


def test_a_frame_is_as_documented() -> None:
    body = bytes((0x03, 7)) + b"\0\1\0\0hi"
    crc = binascii.crc_hqx(body, 0xFFFF)
    assert encode_frame(0x03, 7, b"\0\1\0\0hi") == cobs.encode(body + bytes((crc & 255, crc >> 8))) + b"\0"
    assert binascii.crc_hqx(b"123456789", 0xFFFF) == 0x29B1  # the check value of CRC-16/IBM-3740


@given(
    st.lists(st.tuples(st.integers(0, 255), st.integers(0, 255), st.binary(max_size=600)), max_size=8),
    st.integers(1, 97),
)
def test_frames_come_back_however_they_are_cut(frames: list[tuple[int, int, bytes]], step: int) -> None:
    split, counts = splitter()
    line = b"".join(encode_frame(*frame) for frame in frames)
    received = [frame for at in range(0, len(line), step) for frame in split.feed(line[at : at + step])]
    assert received == [Frame(*frame) for frame in frames]
    assert not counts


@given(st.binary(max_size=3000))
def test_garbage_ends_at_the_next_zero(garbage: bytes) -> None:
    split, _ = splitter()
    list(split.feed(garbage))
    list(split.feed(b"\0"))
    assert list(split.feed(encode_frame(3, 1, b"after"))) == [Frame(3, 1, b"after")]


def test_a_megabyte_of_garbage_is_counted_and_bounded() -> None:
    split, counts = splitter(max_bytes=64)
    rng = random.Random(13)
    for _ in range(256):
        list(split.feed(rng.randbytes(4096)))
        assert len(split._buffer) < 80
    assert counts["too_long"] > 100
    assert counts["bad_frame"] > 100
    list(split.feed(b"\0"))
    assert list(split.feed(encode_frame(1, 0, b"x"))) == [Frame(1, 0, b"x")]


def test_wrong_bits_are_reported_by_the_checksum() -> None:
    split, counts = splitter()
    body = bytes((3, 1)) + b"payload"
    wrong = cobs.encode(body + (binascii.crc_hqx(body, 0xFFFF) ^ 1).to_bytes(2, "little")) + b"\0"
    assert list(split.feed(wrong)) == []
    assert counts == {"bad_crc": 1}


@pytest.mark.parametrize("size", [0, 1, 253, 254, 255, 508, 509])
@pytest.mark.parametrize("filler", [b"\0", b"\xff"])
def test_block_edges_of_cobs(size: int, filler: bytes) -> None:
    split, _ = splitter()
    assert list(split.feed(encode_frame(3, 0, filler * size))) == [Frame(3, 0, filler * size)]
