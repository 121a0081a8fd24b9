"""Many patterns at once: which of them an event matches, without asking each.

Every field that a pattern names has a table of what all patterns ask of it. An event goes through the fields that are
both in it and in a pattern; what its values satisfy is a set of clauses (`marks`), and the sets are intersected. A
clause is looked for by the rarest field that it needs, so that a rule about a field that the event lacks costs nothing.

Where a clause asks two fields of a list of objects, that finds too many, as each may hold for another object: those
patterns are asked again, one by one. Else the sets are the answer.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from metaros.automation.rules.clauses import Clause, Path, clauses_of
from metaros.automation.rules.field_matcher import FieldMatcher, flat
from metaros.automation.rules.path_table import PathTable
from metaros.automation.rules.pattern import Pattern, compile_pattern

__all__ = ["PatternIndex"]


@dataclass(slots=True, eq=False)
class _FieldNode:
    """A field that patterns name: its table if one asks for its value, and the fields below it."""

    table: PathTable | None = None
    below: dict[str, _FieldNode] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class _IndexedClause:
    """A clause at its bit: whose it is, its tables, and those among them in which it needs a value."""

    key: str
    pattern: Pattern
    exact: bool
    tables: frozenset[PathTable]
    needed: frozenset[PathTable]
    leaves: dict[Path, FieldMatcher]

    def settled(self, below_lists: set[PathTable]) -> bool:
        """Whether that its fields hold is all: not more than one is below a list, nor may one be absent there."""
        touched = self.tables & below_lists if below_lists else below_lists
        return self.exact and (not touched or (len(touched) == 1 and touched <= self.needed))


class _Found:
    """The values of an event at the fields that matter, and which of these are in objects of a list."""

    __slots__ = ("below_lists", "values")

    def __init__(self) -> None:
        self.values: dict[PathTable, list[Any]] = {}
        self.below_lists: set[PathTable] = set()

    def visit(self, spot: _FieldNode, node: dict[str, Any], in_list: bool = False) -> None:
        """Through an object of the event."""
        names = spot.below if len(spot.below) <= len(node) else node
        for name in names:
            if name in node and (child := spot.below.get(name)) is not None:
                value = node[name]
                kind = type(value)
                if kind is dict:
                    self.visit(child, value, in_list)
                elif kind is list:
                    self._list(child, value, in_list)
                elif child.table is not None:
                    self._note(child.table, value, in_list)

    def _list(self, spot: _FieldNode, items: list[Any], in_list: bool) -> None:
        for item in flat(items):
            if type(item) is dict:
                self.visit(spot, item, True)
            elif spot.table is not None:
                self._note(spot.table, item, in_list)

    def _note(self, table: PathTable, value: Any, in_list: bool) -> None:
        self.values.setdefault(table, []).append(value)
        if in_list:
            self.below_lists.add(table)


class PatternIndex:
    """Patterns by keys; for one thread at a time."""

    def __init__(self) -> None:
        self._root = _FieldNode()
        self._places: list[_IndexedClause | None] = []
        self._free: list[int] = []
        self._bits: dict[str, list[int]] = {}
        self._unanchored = 0  # clauses that hold where nothing is

    def __len__(self) -> int:
        return len(self._bits)

    def __contains__(self, key: object) -> bool:
        return key in self._bits

    def put(self, key: str, pattern: Pattern | Mapping[str, Any]) -> None:
        """Keep a pattern under a key, in place of the one that it had; PatternError as `compile_pattern` has it."""
        made = pattern if isinstance(pattern, Pattern) else compile_pattern(pattern)
        self.remove(key)
        self._bits[key] = [self._add(key, made, clause) for clause in clauses_of(made.root)]

    def remove(self, key: str) -> None:
        """Forget a key's pattern, if it has one."""
        for number in self._bits.pop(key, ()):
            place, self._places[number] = self._places[number], None
            self._free.append(number)
            self._unanchored &= ~(1 << number)
            for path, leaf in place.leaves.items() if place else ():
                self._table(path).remove(1 << number, leaf)
                self._prune(path)

    def match(self, event: Mapping[str, Any]) -> list[str]:
        """The keys of all patterns that the event matches, each once, in no particular order."""
        node = event if type(event) is dict else dict(event)
        found = _Found()
        found.visit(self._root, node)
        there = set(found.values)
        keys: dict[str, None] = {}
        for number in _numbers(self._candidates(found)):
            place = self._places[number]
            if place is None or place.key in keys or not place.needed <= there:
                continue
            if place.settled(found.below_lists) or place.pattern.matches(node):
                keys[place.key] = None
        return list(keys)

    def _candidates(self, found: _Found) -> int:
        """The clauses that are content with what the event has where they ask."""
        candidates, refused = self._unanchored, 0
        for table, values in found.values.items():
            satisfied = table.satisfied(values)
            if table in found.below_lists:
                satisfied |= table.absent
            candidates |= satisfied & table.anchored
            refused |= table.asking & ~satisfied
        return candidates & ~refused

    def _add(self, key: str, pattern: Pattern, clause: Clause) -> int:
        number = self._free.pop() if self._free else len(self._places)
        if number == len(self._places):
            self._places.append(None)
        bit = 1 << number
        needed = [self._table(path) for path, leaf in clause.leaves.items() if not leaf.absent]
        if needed:
            min(reversed(needed), key=lambda table: table.asking.bit_count()).anchored |= bit
        else:
            self._unanchored |= bit
        for path, leaf in clause.leaves.items():
            self._table(path).put(bit, leaf)
        tables = frozenset(self._table(path) for path in clause.leaves)
        self._places[number] = _IndexedClause(key, pattern, clause.exact, tables, frozenset(needed), clause.leaves)
        return number

    def _table(self, path: Path) -> PathTable:
        spot = self._root
        for name in path:
            spot = spot.below.setdefault(name, _FieldNode())
        if spot.table is None:
            spot.table = PathTable()
        return spot.table

    def _prune(self, path: Path) -> None:
        """Forget a field that nobody asks for any more, and those above it that are empty then."""
        trail = [self._root]
        for name in path:
            trail.append(trail[-1].below[name])
        if trail[-1].table is not None and not trail[-1].table.asking:
            trail[-1].table = None
        for above, name, spot in zip(trail[-2::-1], path[::-1], trail[:0:-1], strict=True):
            if spot.table is None and not spot.below:
                del above.below[name]


def _numbers(bits: int) -> Iterator[int]:
    """The places of the bits that are set."""
    while bits:
        lowest = bits & -bits
        yield lowest.bit_length() - 1
        bits ^= lowest
