"""Event patterns: which events a rule is about, in the language of Amazon EventBridge.

A pattern has the form of the events it is about. All its fields must hold, one entry of a field's list is enough, and
what it does not name does not matter. `docs/reference/patterns.md` is the language.

Where an event has a list of objects, all that an object of the pattern asks must hold for one and the same of them.
A field is absent there if it is absent in each of them, or in the one for which the rest holds.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from metaros.automation.rules.errors import PatternError
from metaros.automation.rules.field_matcher import ABSENT, NO, YES, FieldMatcher, flat, read_leaf
from metaros.limits import LIMITS, Limits

__all__ = ["EITHER", "Branch", "Pattern", "compile_pattern"]

EITHER = "$or"
_NOTHING: dict[str, Any] = {}


@dataclass(frozen=True, slots=True)
class Branch:
    """An object of a pattern: its fields, and the objects of its `$or`, of which one must hold."""

    fields: tuple[tuple[str, FieldMatcher | Branch], ...]
    either: tuple[Branch, ...] = ()

    def evaluate(self, value: Any) -> int:
        """NO, ABSENT or YES for a value of an event; what is no object has no fields."""
        if type(value) is not list:
            return self._object(value if type(value) is dict else _NOTHING)
        worst = YES
        for item in flat(value):
            found = self._object(item if type(item) is dict else _NOTHING)
            if found == YES:
                return YES
            worst = min(worst, found)
        return self._object(_NOTHING) if worst == YES else worst

    def _object(self, value: dict[str, Any]) -> int:
        best = ABSENT
        for name, part in self.fields:
            found = part.evaluate(value.get(name, _NOTHING))
            if found == NO:
                return NO
            best = max(best, found)
        if self.either:
            found = max(branch._object(value) for branch in self.either)
            return NO if found == NO else max(best, found)
        return best


class Pattern:
    """A pattern that was read; `document` is what it was read from."""

    __slots__ = ("document", "root")

    def __init__(self, document: Mapping[str, Any], root: Branch) -> None:
        """Made by `compile_pattern`."""
        self.document = document
        self.root = root

    def matches(self, event: Mapping[str, Any]) -> bool:
        """Whether an event, as JSON was read into dicts and lists, is one of those that are meant."""
        return self.root.evaluate(event if type(event) is dict else dict(event)) != NO


def compile_pattern(document: Mapping[str, Any], *, limits: Limits = LIMITS) -> Pattern:
    """Read a pattern.

    Raises:
        PatternError: it is none, or over `pattern_bytes`, `pattern_depth` or `pattern_values`.
    """
    if not isinstance(document, Mapping):
        raise PatternError("", "a pattern is an object like {'source': ['metaros']}")
    root = _Reader(limits).branch(document, "", 1)
    size_bytes = len(json.dumps(document, ensure_ascii=False, default=dict).encode("utf-8", "surrogatepass"))
    if size_bytes > limits.pattern_bytes:
        raise PatternError("", f"has {size_bytes} bytes as JSON; at most {limits.pattern_bytes} (pattern_bytes)")
    return Pattern(document, root)


class _Reader:
    """Reads objects of a pattern and counts their values."""

    def __init__(self, limits: Limits) -> None:
        self._limits = limits
        self._values = 0

    def branch(self, document: Mapping[str, Any], path: str, depth: int) -> Branch:
        """One object, and all below it."""
        if depth > self._limits.pattern_depth:
            raise PatternError(path[:200], f"is deeper than {self._limits.pattern_depth} objects (pattern_depth)")
        if not document:
            raise PatternError(path, "an empty object says nothing; every event has [{'prefix': ''}] as its source")
        fields: list[tuple[str, FieldMatcher | Branch]] = []
        either: tuple[Branch, ...] = ()
        for name, value in document.items():
            if not isinstance(name, str):
                raise PatternError(path, f"{str(name)[:40]!r}: a field's name is a text")
            here = f"{path}.{name[:80]}" if path else name[:80]
            self._count(here, 1)
            if name == EITHER:
                either = self._either(value, here, depth)
            elif isinstance(value, Mapping):
                fields.append((name, self.branch(value, here, depth + 1)))
            elif isinstance(value, list):
                fields.append((name, read_leaf(value, here, self._count)))
            else:
                raise PatternError(here, f"is a list of values or an object, as in ['{str(value)[:40]}']")
        return Branch(tuple(fields), either)

    def _either(self, value: Any, path: str, depth: int) -> tuple[Branch, ...]:
        if not isinstance(value, list) or len(value) < 2 or not all(isinstance(item, Mapping) for item in value):
            raise PatternError(path, "is a list of two objects or more, of which one must hold")
        return tuple(self.branch(item, f"{path}[{number}]", depth + 1) for number, item in enumerate(value))

    def _count(self, path: str, values: int) -> None:
        self._values += values
        if self._values > self._limits.pattern_values:
            raise PatternError(path, f"more than {self._limits.pattern_values} fields and values (pattern_values)")
