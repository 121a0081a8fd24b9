"""Hypothesis strategies: JSON documents and patches."""

from __future__ import annotations

from hypothesis import settings
from hypothesis import strategies as st

__all__ = ["DOCUMENTS", "FEW", "PATCHES", "PLAIN", "VALUES"]

FEW = settings(max_examples=30)  # to draw trees is dear, and `make campaign` draws more
_KEYS = st.sampled_from(["a", "b", "c", "/lidar", "~x", "a/b", "", "é"]) | st.text(
    st.characters(codec="utf-8"), max_size=4
)
_LEAVES = (
    st.booleans()
    | st.integers(-(2**63), 2**63 - 1)
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(st.characters(codec="utf-8"), max_size=5)
)


def _trees(leaves: st.SearchStrategy[object]) -> st.SearchStrategy[object]:
    return st.recursive(
        leaves,
        lambda inner: st.lists(inner, max_size=3) | st.dictionaries(_KEYS, inner, max_size=4),
        max_leaves=12,
    )


PLAIN = _trees(_LEAVES)  # without null
VALUES = _trees(_LEAVES | st.none())
DOCUMENTS = st.dictionaries(_KEYS, PLAIN, max_size=4)
PATCHES = st.dictionaries(_KEYS, VALUES, max_size=4)
