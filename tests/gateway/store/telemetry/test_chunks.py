"""Columns of a chunk: every bit comes back, the summary is of the numbers, damage is noticed."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gateway.store.telemetry.chunks import ENCODING, PLAIN, EncodedChunk, decode
from gateway.store.telemetry.encode import encode, encode_many

STAMPS = st.one_of(
    st.integers(-(2**63), 2**63 - 1),
    st.integers(1_790_000_000_000_000_000, 1_790_000_000_000_100_000),
)
VALUES = st.one_of(
    st.floats(),
    st.floats(width=32),
    st.sampled_from((0.0, -0.0, 1.5, float("nan"), float("inf"), -float("inf"))),
)


def back(*chunks: EncodedChunk) -> tuple[list[int], list[int]]:
    """The rows of chunks, values as bits."""
    stamps, values = decode([(chunk.encoding, chunk.count, chunk.stamps, chunk.vals) for chunk in chunks])
    return stamps.tolist(), values.view(np.uint64).tolist()


@given(st.lists(st.lists(st.tuples(STAMPS, VALUES), min_size=1, max_size=60), max_size=6), st.booleans())
@settings(max_examples=30)
def test_every_bit_comes_back_in_the_order_of_stamps(rows: list[list[tuple[int, float]]], closed: bool) -> None:
    chunks, stamps, bits = [], [], []
    for some in rows:
        columns = np.array([row[0] for row in some], np.int64), np.array([row[1] for row in some])
        chunks.append(encode(*columns, closed=closed))
        order = np.argsort(columns[0], kind="stable")
        stamps += columns[0][order].tolist()
        bits += columns[1][order].view(np.uint64).tolist()
    assert back(*chunks) == (stamps, bits)


def typical(kind: str) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    rng = np.random.default_rng(3)
    walk = np.cumsum(rng.normal(size=1000)) / 100
    return {
        "constant": np.full(1000, 3.3),
        "single": walk.astype(np.float32).astype(np.float64),
        "decimals": np.round(walk, 3),
        "levels": np.floor(walk * 3),
        "smooth": np.sin(np.arange(1000) / 90),
        "noise": rng.normal(size=1000),
    }[kind]


@pytest.mark.parametrize(
    ("kind", "size_bytes"),
    [("constant", 9), ("single", 4001), ("decimals", 3500), ("levels", 700), ("smooth", 6900), ("noise", 8001)],
)
def test_typical_values_get_small(kind: str, size_bytes: int) -> None:
    values, stamps = typical(kind), np.arange(1000) * 10_000_000
    chunk = encode(stamps, values)
    assert back(chunk) == (stamps.tolist(), values.view(np.uint64).tolist())
    assert len(chunk.vals) <= size_bytes
    assert len(chunk.stamps) == 18  # a regular series
    jitter = np.random.default_rng(4).integers(0, 1_000_000, 1000)
    jittered = encode(stamps + jitter, values)
    assert back(jittered)[0] == (stamps + jitter).tolist()
    assert len(jittered.stamps) < 3400


def test_the_summary_is_of_the_numbers() -> None:
    nan = float("nan")
    chunk = encode(np.array([30, 10, 20, 40, 50]), np.array([2.0, nan, -1.0, 5.0, 5.0]))
    assert (chunk.first_ns, chunk.last_ns, chunk.count, chunk.valid) == (10, 50, 5, 4)
    assert (chunk.low, chunk.low_ns, chunk.high, chunk.high_ns, chunk.total) == (-1.0, 20, 5.0, 40, 11.0)
    none = encode(np.array([1]), np.array([nan]))
    assert (none.valid, none.low, none.high, none.total, none.low_ns) == (0, None, None, None, None)
    endless = encode(np.array([1, 2]), np.array([float("inf"), -float("inf")]))
    assert (endless.valid, endless.low, endless.high, endless.total) == (2, -float("inf"), float("inf"), None)


def test_many_at_once_are_what_each_is_alone() -> None:
    kinds = ("constant", "single", "decimals", "levels", "smooth", "noise")
    values = np.array([typical(kind) for kind in kinds])
    values[1, 3] = values[4, :] = np.nan
    stamps = np.arange(1000) * 10_000_000 + np.arange(6)[:, None] * np.random.default_rng(4).integers(0, 10**9, 1000)
    for closed in (True, False):
        alone = [encode(*rows, closed=closed) for rows in zip(stamps, values, strict=True)]
        assert encode_many(stamps, values, closed=closed) == alone


def test_columns_of_an_earlier_program_are_read_beside_new_ones() -> None:
    stamps, values = np.array([1, 2, 3]), np.array([0.5, 1.5, 0.5])
    new = encode(stamps, values)
    old = (PLAIN, 3, stamps.tobytes(), values.tobytes())
    found = decode([old, (ENCODING, 3, new.stamps, new.vals), old])
    assert found[0].tolist() == [1, 2, 3] * 3
    assert found[1].tolist() == [0.5, 1.5, 0.5] * 3
    assert decode([])[0].tolist() == []


def test_damage_is_a_value_error() -> None:
    chunk = encode(np.arange(1000) ** 2, typical("levels"))
    good = (ENCODING, 1000, chunk.stamps, chunk.vals)
    flipped = bytearray(chunk.vals)
    flipped[len(flipped) // 2] ^= 255
    for bad in (
        (ENCODING, 1000, chunk.stamps, bytes(flipped)),
        (ENCODING, 1000, chunk.stamps, chunk.vals[:-9]),
        (ENCODING, 1000, chunk.stamps[:-9], chunk.vals),
        (ENCODING, 1000, b"", chunk.vals),
        (ENCODING, 1000, chunk.stamps, b""),
        (ENCODING, 999, chunk.stamps, chunk.vals),
        (ENCODING + 1, 1000, chunk.stamps, chunk.vals),
        (PLAIN, 1000, b"12345678", b"12345678"),
    ):
        with pytest.raises(ValueError, match=r"a chunk"):
            decode([good, bad])
