"""Wide strings as Fast CDR 1 writes them: UTF-16 code units, each in four bytes, no NUL."""

from __future__ import annotations

from typing import TYPE_CHECKING

from metaros.lazy_import import LazyModule

if TYPE_CHECKING:
    import numpy as np
else:
    np = LazyModule("numpy")

__all__ = ["decode_wide", "encode_wide"]


def encode_wide(text: str, order: str = "<") -> bytes:
    """The units of `text`, four bytes each."""
    units = np.frombuffer(text.encode("utf-16-le"), "<u2")
    return units.astype(f"{order}u4").tobytes()


def decode_wide(data: bytes | memoryview, start: int, count: int, order: str = "<", errors: str = "strict") -> str:
    """The text of `count` units from `start`; `ValueError` if they are not there or no text."""
    if not count:
        return ""
    units = np.frombuffer(data, f"{order}u4", count, start)
    if int(units.max()) > 0xFFFF:
        raise ValueError("a unit of a wide string is larger than 16 bits")
    return units.astype("<u2").tobytes().decode("utf-16-le", errors)
