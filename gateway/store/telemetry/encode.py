"""Rows into chunks, many of them at once: what is asked of each column is asked of a whole matrix, a row a chunk.

The forms are those of `gateway.store.telemetry.chunks`. Compression is tried for each blob by itself, with one context
for all of them: making one takes as long as compressing four kilobytes.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import zstandard

from gateway.store.telemetry.chunks import (
    CONSTANT,
    DOUBLE,
    PLANES,
    SINGLE,
    STAMPS_HEAD,
    ZSTD,
    EncodedChunk,
    Stamps,
    Values,
)

__all__ = ["encode", "encode_many"]

_Summary = tuple[int, float | None, float | None, float | None, int | None, int | None]
_ADDABLE = 1e300
_LEVEL = 3
_OPEN_LEVEL = 1


def encode(stamps: Stamps, values: Values, *, closed: bool = True) -> EncodedChunk:
    """Rows as a chunk, sorted by stamp (a robot's clock may have been set back); at least one.

    A chunk that is not `closed` will be made again soon, so less time is spent on it.
    """
    return encode_many(stamps[None], values[None], closed=closed)[0]


def encode_many(stamps: Stamps, values: Values, *, closed: bool = True) -> list[EncodedChunk]:
    """The same of chunks of one length, each a row of both matrices."""
    if np.any(stamps[:, 1:] < stamps[:, :-1]):
        order = np.argsort(stamps, axis=1, kind="stable")
        stamps, values = np.take_along_axis(stamps, order, 1), np.take_along_axis(values, order, 1)
    zstd = zstandard.ZstdCompressor(level=_LEVEL if closed else _OPEN_LEVEL, write_checksum=True)
    first, last = stamps[:, 0].tolist(), stamps[:, -1].tolist()
    columns = zip(
        first, last, _summaries(stamps, values), _stamps_blobs(stamps, zstd), _values_blobs(values, zstd, closed),
        strict=True,
    )  # fmt: skip
    return [
        EncodedChunk(
            first_ns=first_ns,
            last_ns=last_ns,
            count=stamps.shape[1],
            valid=valid,
            low=low,
            high=high,
            total=total,
            low_ns=low_ns,
            high_ns=high_ns,
            stamps=stamps_blob,
            vals=values_blob,
        )
        for first_ns, last_ns, (valid, low, high, total, low_ns, high_ns), stamps_blob, values_blob in columns
    ]


def _summaries(stamps: Stamps, values: Values) -> list[_Summary]:
    """(how many are numbers, their lowest, highest and sum, the stamps of lowest and highest) of each chunk."""
    numbers = ~np.isnan(values)
    if numbers.all():
        return _of_numbers(stamps, values)
    found: list[_Summary] = []
    for times, row, held in zip(stamps, values, numbers, strict=True):
        some = row[held][None]
        found += _of_numbers(times[held][None], some) if some.size else [(0, None, None, None, None, None)]
    return found


def _of_numbers(stamps: Stamps, values: Values) -> list[_Summary]:
    rows, count = values.shape
    every = np.arange(rows)
    least, most = values.argmin(axis=1), values.argmax(axis=1)
    with np.errstate(invalid="ignore", over="ignore"):
        totals = values.sum(axis=1)
    return [
        (count, low, high, total if abs(total) < _ADDABLE else None, low_ns, high_ns)
        for low, high, total, low_ns, high_ns in zip(
            values[every, least].tolist(),
            values[every, most].tolist(),
            totals.tolist(),
            stamps[every, least].tolist(),
            stamps[every, most].tolist(),
            strict=True,
        )
    ]


def _stamps_blobs(stamps: Stamps, zstd: zstandard.ZstdCompressor) -> list[bytes]:
    distances = np.diff(stamps.view(np.uint64), axis=1)  # sorted, so that no distance is negative, however far apart
    if not distances.shape[1]:
        return [STAMPS_HEAD.pack(0, 0, first, 0) for first in stamps[:, 0].tolist()]
    smallest = distances.min(axis=1)
    distances -= smallest[:, None]
    largest, planes = distances.max(axis=1).tolist(), _planes(distances.astype("<u8", copy=False))
    blobs = []
    for first, least, most, rest in zip(stamps[:, 0].tolist(), smallest.tolist(), largest, planes, strict=True):
        width = (most.bit_length() + 7) // 8
        plain = rest[:width].tobytes()
        packed = zstd.compress(plain) if width else b""
        small = bool(width) and _worth_it(packed, plain)
        blobs.append(STAMPS_HEAD.pack(width, small, first, least) + (packed if small else plain))
    return blobs


def _values_blobs(values: Values, zstd: zstandard.ZstdCompressor, closed: bool) -> list[bytes]:
    bits = np.ascontiguousarray(values).view(np.uint64)
    constant = (bits == bits[:, :1]).all(axis=1)
    with np.errstate(over="ignore", invalid="ignore"):
        single = values.astype("<f4")
        exact = (single.astype(np.float64).view(np.uint64) == bits).all(axis=1)
    double = values.astype("<f8", copy=False)
    doubles, singles = _planes(double), _planes(single)
    blobs = []
    for row, (same, short) in enumerate(zip(constant.tolist(), exact.tolist(), strict=True)):
        if same:
            blobs.append(bytes([CONSTANT]) + double[row, :1].tobytes())
            continue
        kind, column, planes = (SINGLE, single, singles) if short else (DOUBLE, double, doubles)
        plain = column[row].tobytes()
        form, body = kind | PLANES | ZSTD, zstd.compress(planes[row].tobytes())
        if closed:  # decimal fractions have repeating doubles whose planes do not repeat
            form, body = min((form, body), (kind | ZSTD, zstd.compress(plain)), key=lambda item: len(item[1]))
        if not _worth_it(body, plain):
            form, body = kind, plain
        blobs.append(bytes([form]) + body)
    return blobs


def _planes(numbers: npt.NDArray[np.generic]) -> npt.NDArray[np.uint8]:
    """Of each row first the lowest bytes of all numbers, then the next: alike bytes come together."""
    rows, count = numbers.shape
    return np.ascontiguousarray(numbers.view(np.uint8).reshape(rows, count, -1).transpose(0, 2, 1))


def _worth_it(packed: bytes, plain: bytes) -> bool:
    """Whether it saves an eighth: unpacking takes longer than anything else of the reading."""
    return len(packed) <= len(plain) * 7 // 8
