"""What a field's value may be asked: the single conditions of the pattern language, each on one scalar."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from metaros.automation.rules.cidr import Block, address
from metaros.automation.rules.numeric import Span
from metaros.automation.rules.wildcard import Wildcard

__all__ = ["AnythingBut", "Condition", "Exact", "Folded", "InBlock", "Key", "Like", "Prefix", "Suffix", "key_of"]

Key = Any  # of a dict: a text, a number, None, or what stands for true and false
_BOOLEANS: dict[bool, Key] = {True: ("true",), False: ("false",)}


def key_of(value: Any) -> Key:
    """By which equal values of JSON are the same key, and only they: 1 is 1.0 and 1e0, but not true."""
    return _BOOLEANS[value] if type(value) is bool else value


@dataclass(frozen=True, slots=True)
class Exact:
    """One of these values."""

    keys: frozenset[Key]

    def matches(self, value: Any) -> bool:
        """Whether it is."""
        return key_of(value) in self.keys


@dataclass(frozen=True, slots=True)
class Prefix:
    """A text that begins with `text`; with `fold`, which is in small letters then, in letters of any case."""

    text: str
    fold: bool = False

    def matches(self, value: Any) -> bool:
        """Whether it does."""
        return type(value) is str and (value.lower() if self.fold else value).startswith(self.text)


@dataclass(frozen=True, slots=True)
class Suffix:
    """A text that ends with `text`, like `Prefix`."""

    text: str
    fold: bool = False

    def matches(self, value: Any) -> bool:
        """Whether it does."""
        return type(value) is str and (value.lower() if self.fold else value).endswith(self.text)


@dataclass(frozen=True, slots=True)
class Folded:
    """A text that is `text`, which is in small letters, in letters of any case."""

    text: str

    def matches(self, value: Any) -> bool:
        """Whether it is."""
        return type(value) is str and value.lower() == self.text


@dataclass(frozen=True, slots=True)
class Like:
    """A text that a wildcard fits."""

    wildcard: Wildcard

    def matches(self, value: Any) -> bool:
        """Whether it does."""
        return type(value) is str and self.wildcard.fits(value)


@dataclass(frozen=True, slots=True)
class InBlock:
    """An IP address of a block."""

    block: Block

    def matches(self, value: Any) -> bool:
        """Whether it is one."""
        found = address(value)
        return found is not None and found in self.block


@dataclass(frozen=True, slots=True)
class AnythingBut:
    """A value of any kind for which none of these holds."""

    conditions: tuple[Exact | Prefix | Suffix | Folded | Like, ...]

    def matches(self, value: Any) -> bool:
        """Whether none does."""
        return not any(condition.matches(value) for condition in self.conditions)


Condition = Exact | Prefix | Suffix | Folded | Like | InBlock | AnythingBut | Span
