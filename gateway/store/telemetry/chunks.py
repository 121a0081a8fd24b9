"""A chunk of one series: how its two columns are kept as small blobs, and how they are read.

Stamps are kept as their distances: the smallest one once, and what each has above it in as few bytes as the largest
needs, byte planes apart; a regular series costs 18 bytes a chunk. Values are tried in a few forms (one constant,
float32 where that is exact, byte planes apart, as they are), and the smallest is kept, unless it saves less than an
eighth: then they stay as they are, which is the fastest to read.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import zstandard

__all__ = [
    "CONSTANT",
    "DOUBLE",
    "ENCODING",
    "PLAIN",
    "PLANES",
    "SINGLE",
    "STAMPS_HEAD",
    "TOGETHER",
    "ZSTD",
    "EncodedChunk",
    "Stamps",
    "Values",
    "decode",
]

Stamps = npt.NDArray[np.int64]
Values = npt.NDArray[np.float64]
_Kind = tuple[int, int, bool]
_Chunk = tuple[int, int, bytes, bytes]

PLAIN = 0  # both blobs are arrays of 8-byte numbers: rows of earlier programs
ENCODING = 1  # the forms below
TOGETHER = 64
STAMPS_HEAD = struct.Struct("<BBqQ")  # width of a distance, packed, first stamp, smallest distance
CONSTANT, DOUBLE, SINGLE = 1, 2, 4  # what a value is
PLANES, ZSTD = 16, 32  # how the bytes are kept


@dataclass(frozen=True, slots=True, kw_only=True)
class EncodedChunk:
    """What a chunk's row holds. `valid` counts the values that are numbers; the summary is of those.

    Where there are none, the summary is None; `total` is also None where it may not be added to others: near the end
    of what a double holds databases refuse to.
    """

    first_ns: int
    last_ns: int
    count: int
    valid: int
    low: float | None
    high: float | None
    total: float | None
    low_ns: int | None
    high_ns: int | None
    stamps: bytes
    vals: bytes
    encoding: int = ENCODING


def decode(chunks: Sequence[_Chunk]) -> tuple[Stamps, Values]:
    """The rows of chunks given as (encoding, count, stamps, vals), one after the other.

    Best `TOGETHER` at a time: one by one they cost three times as much, and so do more than the cache holds.
    ValueError when any of them is damaged, or of a newer program.
    """
    ends = np.cumsum([chunk[1] for chunk in chunks], dtype=np.int64).tolist()
    places = [slice(end - chunk[1], end) for end, chunk in zip(ends, chunks, strict=True)]
    total = ends[-1] if ends else 0
    stamps, values = np.empty(total, np.int64), np.empty(total)
    unpack = zstandard.ZstdDecompressor()  # its making costs more than its work on one chunk
    try:
        for kind, members in _alike(_stamps_kind(chunk) for chunk in chunks):
            _fill(stamps, places, members, _read_stamps(kind, [chunks[n][2] for n in members], unpack))
        for kind, members in _alike(_values_kind(chunk) for chunk in chunks):
            _fill(values, places, members, _read_values(kind, [chunks[n][3] for n in members], unpack))
    except (struct.error, zstandard.ZstdError, IndexError) as error:
        raise ValueError(f"a chunk's columns are damaged: {error}") from error
    return stamps, values


def _alike(kinds: Iterable[_Kind]) -> Iterable[tuple[_Kind, list[int]]]:
    """The numbers of the chunks that are kept the same way."""
    groups: dict[_Kind, list[int]] = {}
    for number, kind in enumerate(kinds):
        groups.setdefault(kind, []).append(number)
    return groups.items()


def _fill(column: npt.NDArray[Any], places: list[slice], members: list[int], rows: npt.NDArray[Any]) -> None:
    for member, row in zip(members, rows, strict=True):
        column[places[member]] = row


def _stamps_kind(chunk: _Chunk) -> _Kind:
    """(count, width of a distance or 0, packed); width -1 is a plain column."""
    encoding, count, stamps, _ = chunk
    if encoding == PLAIN:
        return count, -1, False
    if encoding != ENCODING:
        raise ValueError(f"a chunk has encoding {encoding}, this program knows up to {ENCODING}")
    return count, stamps[0], bool(stamps[1])


def _values_kind(chunk: _Chunk) -> _Kind:
    """(count, the form, unused); form -1 is a plain column."""
    return chunk[1], -1 if chunk[0] == PLAIN else chunk[3][0], False


def _read_stamps(kind: _Kind, blobs: list[bytes], unpack: zstandard.ZstdDecompressor) -> npt.NDArray[np.int64]:
    """One row a chunk."""
    count, width, packed = kind
    if width < 0:
        return _matrix(blobs, 8 * count).view("<i8")
    heads = [STAMPS_HEAD.unpack_from(blob) for blob in blobs]
    steps = np.empty((len(blobs), count), np.uint64)
    steps[:] = np.array([head[3] for head in heads], np.uint64)[:, None]
    if width:
        bodies = [blob[STAMPS_HEAD.size :] for blob in blobs]
        planes = _plain(bodies, (count - 1) * width, unpack if packed else None)
        steps[:, 1:] += _joined(planes, width, wide=8).view("<u8")
    steps[:, 0] = np.array([head[2] for head in heads], np.int64).view(np.uint64)
    return np.cumsum(steps, axis=1, dtype=np.uint64, out=steps).view(np.int64)


def _read_values(kind: _Kind, blobs: list[bytes], unpack: zstandard.ZstdDecompressor) -> npt.NDArray[np.floating[Any]]:
    """One row a chunk."""
    count, form, _ = kind
    if form < 0:
        return _matrix(blobs, 8 * count).view("<f8")
    bodies = [blob[1:] for blob in blobs]
    if form == CONSTANT:
        return np.broadcast_to(_matrix(bodies, 8).view("<f8"), (len(blobs), count))
    width = 4 if form & SINGLE else 8
    plain = _plain(bodies, count * width, unpack if form & ZSTD else None)
    return (_joined(plain, width, wide=width) if form & PLANES else plain).view(f"<f{width}")


def _joined(planes: npt.NDArray[np.uint8], width: int, *, wide: int) -> npt.NDArray[np.uint8]:
    """The reverse of planes, of each row; a number gets `wide` bytes, those it has no plane for are zero."""
    rows, size_bytes = planes.shape
    count = size_bytes // width
    numbers = np.zeros((rows, count, wide), np.uint8)
    for plane in range(width):  # five times as fast as a transpose
        numbers[:, :, plane] = planes[:, plane * count : (plane + 1) * count]
    return numbers.reshape(rows, -1)


def _plain(bodies: list[bytes], size_bytes: int, unpack: zstandard.ZstdDecompressor | None) -> npt.NDArray[np.uint8]:
    """The bodies, unpacked when they are packed, as rows; never more than is expected."""
    if unpack is not None:
        if any(zstandard.frame_content_size(body) != size_bytes for body in bodies):
            raise ValueError("a chunk's column has the wrong length")
        bodies = [unpack.decompress(body) for body in bodies]
    return _matrix(bodies, size_bytes)


def _matrix(bodies: list[bytes], size_bytes: int) -> npt.NDArray[np.uint8]:
    if any(len(body) != size_bytes for body in bodies):
        raise ValueError("a chunk's column has the wrong length")
    return np.frombuffer(b"".join(bodies), np.uint8).reshape(len(bodies), size_bytes)
