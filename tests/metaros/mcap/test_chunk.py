"""A chunk read by itself gives what was written, and nothing else for any bytes."""

from __future__ import annotations

import io
import struct

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from metaros.mcap import MalformedChunkError, McapFile, read_chunk, read_messages

MOST = 1 << 20


def written(payloads: list[bytes], compression: str = "zstd") -> bytes:
    """A chunk with these messages."""
    stream = io.BytesIO()
    file: McapFile[None] = McapFile(stream, compression=compression)
    channel = file.add_channel("/t", file.add_schema("std_msgs/msg/String", b"string data\n"), {})
    for number, payload in enumerate(payloads):
        file.write(channel, 100 + number, 0, number, payload, None)
    file.flush()
    start, size = file.last_chunk
    return stream.getvalue()[start : start + size]


@pytest.mark.parametrize("compression", ["zstd", "none"])
@given(payloads=st.lists(st.binary(max_size=300), min_size=1, max_size=20))
@settings(max_examples=50, deadline=None)
def test_every_message_comes_back(compression: str, payloads: list[bytes]) -> None:
    raw = read_chunk(written(payloads, compression), most_bytes=MOST)
    found = list(read_messages(raw, 0, len(payloads)))
    assert found == [(1, number, 100 + number, payload) for number, payload in enumerate(payloads)]
    with pytest.raises(MalformedChunkError):
        list(read_messages(raw, 0, len(payloads) + 1))
    skip = 31 + len(payloads[0])
    assert [item[3] for item in read_messages(raw, skip, len(payloads) - 1)] == payloads[1:]
    with pytest.raises(MalformedChunkError):
        list(read_messages(raw, 1, 1))


@pytest.mark.parametrize("compression", ["zstd", "none"])
def test_every_damaged_byte_is_seen(compression: str) -> None:
    data = written([b"payload %d" % number for number in range(20)], compression)
    whole, seen = read_chunk(data, most_bytes=MOST), 0
    for place in range(len(data)):
        damaged = bytearray(data)
        damaged[place] ^= 0x41
        if 9 <= place < 25:  # its first and last time, of which its content says nothing
            continue
        try:
            assert read_chunk(bytes(damaged), most_bytes=MOST) == whole, place
        except MalformedChunkError:
            seen += 1
    assert seen > 0.95 * len(data) - 16


def test_pieces_and_foreign_bytes() -> None:
    data = written([b"x" * 100])
    for size in range(len(data)):
        with pytest.raises(MalformedChunkError):
            read_chunk(data[:size], most_bytes=MOST)
    with pytest.raises(MalformedChunkError):
        read_chunk(data + b"\0", most_bytes=MOST)
    with pytest.raises(MalformedChunkError, match="lz4"):
        read_chunk(written([b"x" * 100], "lz4"), most_bytes=MOST)


def test_a_size_that_is_a_lie_takes_no_memory() -> None:
    data = bytearray(written([bytes(100_000)]))
    with pytest.raises(MalformedChunkError, match="bound"):
        read_chunk(bytes(data), most_bytes=1000)
    struct.pack_into("<Q", data, 25, 10)
    with pytest.raises(MalformedChunkError):
        read_chunk(bytes(data), most_bytes=1000)
