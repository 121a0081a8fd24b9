"""Detectors' state as bytes: versioned, with the parameter set it belongs to, compressed, with a checksum."""

from __future__ import annotations

import struct

import numpy as np
import xxhash
import zstandard

from gateway.alerting.anomaly.detectors.state import Bytes
from gateway.alerting.anomaly.parameters import BankConfig
from gateway.errors import DamagedError

__all__ = ["LARGEST_SERIES", "SnapshotError", "pack", "unpack"]

VERSION = 2  # 1 had three novelties
LARGEST_SERIES = 16_384  # in one snapshot
_HEAD = struct.Struct("<4sHQII")  # magic, version, parameters, series, bytes of one
_MAGIC = b"MRAB"
_SUM_BYTES = 8


class SnapshotError(DamagedError):
    """These bytes are no detectors' state, or that of another version or parameter set: learn again."""


def pack(config: BankConfig, rows: Bytes) -> bytes:
    """Rows of bytes, a series each, as one snapshot.

    Raises:
        ValueError: more rows than LARGEST_SERIES.
    """
    if len(rows) > LARGEST_SERIES:
        raise ValueError(f"{len(rows)} series in one snapshot; at most {LARGEST_SERIES}")
    head = _HEAD.pack(_MAGIC, VERSION, _parameters(config), *rows.shape)
    body = head + zstandard.ZstdCompressor(level=1).compress(rows.tobytes())
    return body + xxhash.xxh3_64_digest(body)


def unpack(config: BankConfig, data: bytes, *, row_bytes: int) -> Bytes:
    """The rows of a snapshot.

    Raises:
        SnapshotError: it is damaged, or of another version or parameter set.
    """
    body, checksum = data[:-_SUM_BYTES], data[-_SUM_BYTES:]
    if len(body) < _HEAD.size or xxhash.xxh3_64_digest(body) != checksum:
        raise SnapshotError("the detectors' snapshot is damaged: its checksum differs")
    magic, version, parameters, count, size = _HEAD.unpack_from(body)
    if magic != _MAGIC or version != VERSION:
        raise SnapshotError(f"the detectors' snapshot is of version {version}, not {VERSION}")
    if parameters != _parameters(config) or size != row_bytes or count > LARGEST_SERIES:
        raise SnapshotError("the detectors' snapshot belongs to other parameters")
    try:
        rows = zstandard.ZstdDecompressor().decompress(body[_HEAD.size :], max_output_size=count * size)
    except zstandard.ZstdError as error:
        raise SnapshotError(f"the detectors' snapshot is damaged: {error}") from None
    if len(rows) != count * size:
        raise SnapshotError(f"the detectors' snapshot is damaged: {len(rows)} bytes of {count * size}")
    return np.frombuffer(rows, dtype=np.uint8).reshape(count, size)


def _parameters(config: BankConfig) -> int:
    return xxhash.xxh3_64_intdigest(repr(config).encode())
