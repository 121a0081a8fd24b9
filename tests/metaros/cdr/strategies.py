"""Random message types and random values for them."""

from __future__ import annotations

from typing import Any

import numpy as np
from hypothesis import strategies as st

from metaros.idl import Catalogue, Field, FieldType, MessageDefinition, message_class
from metaros.idl.arrays import DTYPES
from metaros.idl.definitions import INTEGER_RANGES

PRIMITIVES = sorted(DTYPES)
TEXT = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=9)
NARROW = st.text(st.characters(min_codepoint=32, max_codepoint=0xD7FF), max_size=9)


@st.composite
def types(draw: st.DrawFn, nested: tuple[str, ...]) -> FieldType:
    """A field type: mostly primitives, sometimes strings, sometimes one of the `nested` messages."""
    base = draw(st.one_of(st.sampled_from(PRIMITIVES), st.sampled_from(["string", "wstring", *nested])))
    bound = draw(st.sampled_from([0, 0, 5])) if base in ("string", "wstring") else 0
    array = draw(st.sampled_from(["", "", "fixed", "bounded", "unbounded"]))
    capacity = draw(st.integers(1, 4)) if array in ("fixed", "bounded") else 0
    if base == "float64" and array == "fixed" and draw(st.booleans()):
        capacity = 70  # longer than what is packed inline
    return FieldType(base, array, capacity, bound)


@st.composite
def catalogues(draw: st.DrawFn) -> Catalogue:
    """A catalogue in which p/msg/M2 is made of p/msg/M1, and that of p/msg/M0, and of primitives."""
    catalogue = Catalogue()
    names: list[str] = []
    for level in range(3):
        kinds = draw(st.lists(types(tuple(names)), max_size=5))
        name = f"p/msg/M{level}"
        catalogue.add(MessageDefinition(name, tuple(Field(f"f{i}", kind) for i, kind in enumerate(kinds))))
        names.append(name)
    return catalogue


def values(kind: FieldType, catalogue: Catalogue) -> st.SearchStrategy[Any]:
    """Values that fit a field of type `kind`."""
    if not kind.array:
        return _single(kind, catalogue)
    low = kind.capacity if kind.array == "fixed" else 0
    high = kind.capacity or 4
    if kind.base in DTYPES and high > 8:
        return st.just(np.arange(high, dtype=DTYPES[kind.base]))
    listed = st.lists(_single(kind, catalogue), min_size=low, max_size=high)
    if kind.base in DTYPES:
        return listed.map(lambda items: np.array(items, dtype=DTYPES[kind.base]))
    return listed


def messages(name: str, catalogue: Catalogue) -> st.SearchStrategy[Any]:
    """Messages of the type `name`."""
    cls = message_class(name, catalogue)
    fields = catalogue.message(name).fields
    return st.fixed_dictionaries({field.attribute: values(field.type, catalogue) for field in fields}).map(
        lambda chosen: cls(**chosen)
    )


def _single(kind: FieldType, catalogue: Catalogue) -> st.SearchStrategy[Any]:
    if kind.is_nested:
        return messages(kind.base, catalogue)
    if kind.base == "string":
        return TEXT.map(lambda text: _shortened(text, kind.string_bound))
    if kind.base == "wstring":
        return NARROW.map(lambda text: text[: kind.string_bound or None])
    if kind.base == "bool":
        return st.booleans()
    if kind.base in INTEGER_RANGES:
        return st.integers(*INTEGER_RANGES[kind.base])
    return st.floats(width=32 if kind.base == "float32" else 64, allow_nan=False)


def _shortened(text: str, bound: int) -> str:
    while bound and len(text.encode()) > bound:
        text = text[:-1]
    return text
