"""A pattern as its clauses: sets of fields that must all hold, one set of which is enough.

A pattern without `$or` is one clause. The index keeps clauses, since it can tell of one by its fields alone.
"""

from __future__ import annotations

from dataclasses import dataclass

from metaros.automation.rules.field_matcher import FieldMatcher
from metaros.automation.rules.pattern import Branch

__all__ = ["Clause", "Path", "clauses_of"]

Path = tuple[str, ...]
MOST = 32  # of one pattern; of one with more, a `$or` is left out of the index, and asked of the pattern itself


@dataclass(frozen=True, slots=True)
class Clause:
    """Fields with what they must hold; `exact` if that is all there is to it in an event without lists of objects."""

    leaves: dict[Path, FieldMatcher]
    exact: bool = True


def clauses_of(branch: Branch, above: Path = ()) -> list[Clause]:
    """The clauses of a pattern, or of an object in it that is at `above`."""
    found = [Clause({})]
    for name, part in branch.fields:
        path = (*above, name)
        found = _both(found, [Clause({path: part})] if isinstance(part, FieldMatcher) else clauses_of(part, path))
    if branch.either:
        found = _both(found, [clause for either in branch.either for clause in clauses_of(either, above)])
    return found


def _both(these: list[Clause], those: list[Clause]) -> list[Clause]:
    if len(these) * len(those) > MOST:
        return [Clause(clause.leaves, exact=False) for clause in these]
    return [_merged(this, that) for this in these for that in those]


def _merged(this: Clause, that: Clause) -> Clause:
    """A field that both name is indexed by the one and asked for by the other."""
    twice = this.leaves.keys() & that.leaves.keys()
    return Clause({**that.leaves, **this.leaves}, exact=this.exact and that.exact and not twice)
