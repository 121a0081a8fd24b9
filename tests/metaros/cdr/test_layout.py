"""What a generator knows of a position."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st

from metaros.cdr.layout import CODES, Position, size_of


@settings(max_examples=40)
@given(st.integers(0, 1000), st.sampled_from([1, 2, 4, 8]), st.sampled_from([1, 2, 4, 8]), st.integers(0, 99))
def test_positions_are_right_about_real_offsets(offset: int, modulus: int, alignment: int, size: int) -> None:
    known = Position(modulus, offset % modulus)
    gap = known.gap(alignment)
    assert gap is None or (offset + gap) % alignment == 0
    assert (gap is None) == (alignment > modulus)
    assert known.after(size).residue == (offset + size) % modulus


@settings(max_examples=40)
@given(st.integers(0, 99), st.integers(0, 99), st.sampled_from([1, 2, 4, 8]), st.sampled_from([1, 2, 4, 8]))
def test_meeting_keeps_what_both_know(one: int, other: int, first: int, second: int) -> None:
    met = Position(first, one % first).meet(Position(second, other % second))
    assert one % met.modulus == met.residue == other % met.modulus


def test_sizes() -> None:
    assert {size_of(base) for base in CODES} == {1, 2, 4, 8}
