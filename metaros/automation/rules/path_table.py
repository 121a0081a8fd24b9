"""What all clauses ask of one field, and which of them a value satisfies.

A value finds its clauses by lookups: of itself, of its beginnings and ends, of its place among the bounds of spans.
Only what remains (wildcards, spans and refusals of which one list has several) is asked one by one; wildcards only
where the text begins as they do.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

from metaros.automation.rules.conditions import (
    AnythingBut,
    Condition,
    Exact,
    Folded,
    InBlock,
    Key,
    Like,
    Prefix,
    Suffix,
    key_of,
)
from metaros.automation.rules.field_matcher import FieldMatcher
from metaros.automation.rules.numeric import Span, is_number
from metaros.automation.rules.value_index import BoundIndex, CidrIndex, EqualIndex, PrefixIndex

__all__ = ["PathTable"]


class PathTable:
    """One field's table; a clause is a bit."""

    __slots__ = (
        "_begun",
        "_blocks",
        "_exact",
        "_folded",
        "_highs",
        "_lows",
        "_others",
        "_plain_refused",
        "_plain_refusing",
        "_texts",
        "absent",
        "anchored",
        "asking",
        "present",
    )

    def __init__(self) -> None:
        """`asking` are all clauses that ask something of this field, `anchored` those that are looked for here first.

        `absent` and `present` are those that are content with no value, and with any.
        """
        self.asking = self.anchored = self.absent = self.present = 0
        self._plain_refusing = 0
        self._exact, self._folded, self._plain_refused = EqualIndex(), EqualIndex(), EqualIndex()
        self._texts = {
            kind: PrefixIndex() for kind in [(Prefix, False), (Prefix, True), (Suffix, False), (Suffix, True)]
        }
        self._lows, self._highs = BoundIndex(), BoundIndex()
        self._begun: dict[str, EqualIndex] = {}
        self._blocks, self._others = CidrIndex(), EqualIndex()

    def put(self, bit: int, leaf: FieldMatcher) -> None:
        """A clause asks this."""
        self.asking |= bit
        self.absent |= bit if leaf.absent else 0
        self.present |= bit if leaf.present else 0
        self._plain_refusing |= bit if _refuses_plainly(leaf) else 0
        for marks, key in self._places(leaf):
            marks.add(key, bit)

    def remove(self, bit: int, leaf: FieldMatcher) -> None:
        """A clause that asked this is gone."""
        for name in ("asking", "anchored", "absent", "present", "_plain_refusing"):
            setattr(self, name, getattr(self, name) & ~bit)
        for marks, key in self._places(leaf):
            marks.drop(key, bit)
        self._begun = {start: marks for start, marks in self._begun.items() if marks.bits}

    def _places(self, leaf: FieldMatcher) -> Iterator[tuple[EqualIndex, Key]]:
        """Where a clause is marked for what it asks."""
        yield from ((self._exact, key) for key in leaf.exact)
        for condition in leaf.others:
            match condition:
                case Span() if _alone(leaf, Span):
                    yield self._lows, (condition.low, int(not condition.low_closed))
                    yield self._highs, (condition.high, int(condition.high_closed))
                case AnythingBut((Exact(keys),)) if _refuses_plainly(leaf):
                    yield from ((self._plain_refused, key) for key in keys)
                case Folded(text):
                    yield self._folded, text
                case Prefix(text, fold):
                    yield self._texts[Prefix, fold], text
                case Suffix(text, fold):
                    yield self._texts[Suffix, fold], text[::-1]
                case InBlock(block):
                    yield self._blocks, CidrIndex.key(block)
                case Like(wildcard):
                    yield self._begun.setdefault(wildcard.pieces[0], EqualIndex()), condition
                case _:
                    yield self._others, condition

    def satisfied(self, values: Iterable[Any]) -> int:
        """The clauses that are content with one of the values; there is at least one."""
        found = self.present
        for value in values:
            key = key_of(value)
            found |= self._exact.bits.get(key, 0)
            if self._plain_refusing:
                found |= self._plain_refusing & ~self._plain_refused.bits.get(key, 0)
            if type(value) is str:
                found |= self._by_text(value)
            elif self._lows.bits and is_number(value):
                found |= self._lows.up_to(value) & ~self._highs.up_to(value)
            if self._others.bits:
                found |= _asked(self._others.bits, value)
        return found

    def _by_text(self, text: str) -> int:
        found = 0
        for (kind, fold), starts in self._texts.items():
            if starts.bits:
                letters = text.lower() if fold else text
                found |= starts.of(letters if kind is Prefix else letters[::-1])
        if self._folded.bits:
            found |= self._folded.bits.get(text.lower(), 0)
        if self._blocks.bits:
            found |= self._blocks.of(text)
        for start, marks in self._begun.items():
            if text.startswith(start):
                found |= _asked(marks.bits, text)
        return found


def _asked(bits: dict[Condition, int], value: Any) -> int:
    found = 0
    for condition, bit in bits.items():
        if condition.matches(value):
            found |= bit
    return found


def _alone(leaf: FieldMatcher, kind: type[Condition]) -> bool:
    """Whether it has one condition of this kind: two spans may hold each for itself, and not between their bounds."""
    return sum(isinstance(condition, kind) for condition in leaf.others) == 1


def _refuses_plainly(leaf: FieldMatcher) -> bool:
    """Whether its only refusal is one of values; of two, each holds for what the other refuses."""
    plain = any(isinstance(each, AnythingBut) and isinstance(each.conditions[0], Exact) for each in leaf.others)
    return plain and _alone(leaf, AnythingBut)
