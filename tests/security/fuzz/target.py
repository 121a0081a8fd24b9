"""What a fuzz target is: a function from foreign bytes, what it may raise, and how much memory it may take."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

__all__ = ["MIB", "Target"]

MIB = 1024 * 1024


@dataclass(frozen=True, slots=True, kw_only=True)
class Target:
    """`run` takes any bytes and raises nothing but `errors`; `seeds` are inputs that it understands.

    It may take `base_bytes` of memory whatever comes, and `per_byte` for each byte of input.
    """

    name: str
    run: Callable[[bytes], Any]
    errors: tuple[type[Exception], ...]
    seeds: tuple[bytes, ...]
    base_bytes: int = 4 * MIB
    per_byte: int = 200
    cost: int = 1  # how many times as slow as others it is: it gets so many times fewer inputs

    def __call__(self, data: bytes) -> bool:
        """Whether the bytes were understood; whatever is not a documented error comes out."""
        try:
            self.run(data)
        except self.errors:
            return False
        return True
