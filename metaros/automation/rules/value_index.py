"""Indexes of clauses as bit sets: by equal value, text prefix, CIDR block, numeric bound.

A clause is a bit and a set of them an `int`: the union of two sets of a thousand costs as much as an addition.
"""

from __future__ import annotations

from bisect import bisect_right
from itertools import accumulate
from operator import or_

from metaros.automation.rules.cidr import Block, address
from metaros.automation.rules.conditions import Key

__all__ = ["BoundIndex", "CidrIndex", "EqualIndex", "PrefixIndex"]

STEP = 32


class EqualIndex:
    """By values that must be equal."""

    __slots__ = ("bits",)

    def __init__(self) -> None:
        self.bits: dict[Key, int] = {}

    def add(self, key: Key, bit: int) -> None:
        """A clause asks for this."""
        self.bits[key] = self.bits.get(key, 0) | bit

    def drop(self, key: Key, bit: int) -> None:
        """It asks no more; what was never added is dropped as well."""
        left = self.bits.pop(key, 0) & ~bit
        if left:
            self.bits[key] = left


class PrefixIndex(EqualIndex):
    """By beginnings of texts: looked up in each length that there is."""

    __slots__ = ("_lengths",)

    def __init__(self) -> None:
        super().__init__()
        self._lengths: list[int] | None = []

    def add(self, key: Key, bit: int) -> None:
        """A clause asks for this."""
        super().add(key, bit)
        self._lengths = None

    def drop(self, key: Key, bit: int) -> None:
        """It asks no more."""
        super().drop(key, bit)
        self._lengths = None

    def of(self, text: str) -> int:
        """The clauses that ask for a beginning of this text."""
        if self._lengths is None:
            self._lengths = sorted({len(key) for key in self.bits})
        found, bits = 0, self.bits
        for length in self._lengths:
            found |= bits.get(text[:length], 0)
        return found


class CidrIndex(EqualIndex):
    """By blocks of addresses: looked up in each length of block that there is."""

    __slots__ = ("_lengths",)

    def __init__(self) -> None:
        super().__init__()
        self._lengths: set[tuple[int, int]] | None = set()

    @staticmethod
    def key(block: Block) -> Key:
        """Its version, how many bits of its addresses are free, and those before them."""
        free = block.max_prefixlen - block.prefixlen
        return block.version, free, int(block.network_address) >> free

    def add(self, key: Key, bit: int) -> None:
        """A clause asks for this."""
        super().add(key, bit)
        self._lengths = None

    def drop(self, key: Key, bit: int) -> None:
        """It asks no more."""
        super().drop(key, bit)
        self._lengths = None

    def of(self, text: str) -> int:
        """The clauses that ask for a block with this address in it; none where it is no address."""
        where = address(text)
        if where is None:
            return 0
        if self._lengths is None:
            self._lengths = {(version, free) for version, free, _ in self.bits}
        found, bits = 0, int(where)
        for version, free in self._lengths:
            if version == where.version:
                found |= self.bits.get((version, free, bits >> free), 0)
        return found


class BoundIndex(EqualIndex):
    """By bounds of numbers: a number, and 1 where the bound lies right behind it, else 0.

    Every `STEP` bounds, in their order, it has the union of all before them.
    """

    __slots__ = ("_numbers", "_sorted", "_unions")

    def __init__(self) -> None:
        super().__init__()
        self._sorted: list[int] | None = None

    def add(self, key: Key, bit: int) -> None:
        """A clause has this bound."""
        super().add(key, bit)
        self._sorted = None

    def drop(self, key: Key, bit: int) -> None:
        """It has it no more."""
        super().drop(key, bit)
        self._sorted = None

    def up_to(self, value: float) -> int:
        """The clauses whose bound does not lie behind this number."""
        if self._sorted is None:
            self._numbers = sorted(self.bits)
            self._sorted = [self.bits[number] for number in self._numbers]
            unions = accumulate(self._sorted, or_, initial=0)
            self._unions = [union for at, union in enumerate(unions) if at % STEP == 0]
        end = bisect_right(self._numbers, (value, 0))
        found = self._unions[end // STEP]
        for bit in self._sorted[end - end % STEP : end]:
            found |= bit
        return found
