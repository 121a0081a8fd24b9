"""Compressed batches: what comes back, and what is refused before anything is decompressed."""

from __future__ import annotations

import pytest

from metaros._proto import link_pb2
from metaros.errors import FrameError
from metaros.link import compress, decompress, pack_batch
from tests.support.tables import cases

WHOLE = pack_batch(1, 1, 12, [3], [bytes(range(64)) * 8])


def test_a_batch_comes_back_as_it_was() -> None:
    small = link_pb2.Batch.FromString(compress(WHOLE.SerializeToString(), "zstd"))
    assert small.compression == link_pb2.COMPRESSION_ZSTD
    assert len(small.payload) < len(WHOLE.payload) / 2
    assert decompress(small) == WHOLE
    assert decompress(WHOLE) is WHOLE


@cases(
    ("change", "words"),
    [
        ({"compression": 7}, "compression 7 is not known, or not allowed on a chunk"),
        ({"chunk_count": 2}, "compression 1 is not known, or not allowed on a chunk"),
        ({"lengths": b"12345"}, "column lengths has 5 bytes"),
        ({"lengths": b"\xff\xff\xff\x7f"}, "compressed bytes cannot become 2147483647"),
        ({"lengths": b"\x01\x02\0\0"}, "it is not the 513 bytes"),
        ({"payload": b"0123456789"}, "a compressed payload is damaged"),
    ],
)
def test_a_broken_one_is_refused(change: dict[str, object], words: str) -> None:
    small = link_pb2.Batch.FromString(compress(WHOLE.SerializeToString(), "zstd"))
    for name, value in change.items():
        setattr(small, name, value)
    with pytest.raises(FrameError, match=words):
        decompress(small)
