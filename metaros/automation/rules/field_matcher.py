"""The list that a pattern has for a field: it holds if one of its entries does."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from metaros.automation.rules.cidr import read_block
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
from metaros.automation.rules.errors import PatternError
from metaros.automation.rules.numeric import is_number, read_span
from metaros.automation.rules.wildcard import read_wildcard

__all__ = ["ABSENT", "NO", "OPERATORS", "YES", "FieldMatcher", "flat", "read_leaf"]

NO, ABSENT, YES = 0, 1, 2  # does not hold; holds since there is no value; holds for a value
FOLD = "equals-ignore-case"


def flat(values: list[Any]) -> Iterator[Any]:
    """The elements of a list that are no lists, those of lists in it included; without recursion."""
    waiting = [iter(values)]
    while waiting:
        for value in waiting[-1]:
            if type(value) is list:
                waiting.append(iter(value))
                break
            yield value
        else:
            waiting.pop()


@dataclass(frozen=True, slots=True, kw_only=True)
class FieldMatcher:
    """All entries of a list; `exact` are its plain values, `present` and `absent` what it says of `exists`."""

    exact: frozenset[Key] = frozenset()
    others: tuple[Condition, ...] = ()
    present: bool = False
    absent: bool = False

    def evaluate(self, value: Any) -> int:
        """NO, ABSENT or YES for the value of an event's field; an object is none, as only leaves have values."""
        kind = type(value)
        if kind is list:
            found = [item for item in flat(value) if type(item) is not dict]
            if found:
                return YES if any(self.holds(item) for item in found) else NO
        elif kind is not dict:
            return YES if self.holds(value) else NO
        return ABSENT if self.absent else NO

    def holds(self, value: Any) -> bool:
        """Whether it does for one scalar."""
        if self.present or key_of(value) in self.exact:
            return True
        return any(condition.matches(value) for condition in self.others)


def read_leaf(entries: list[Any], path: str, count: Callable[[str, int], None]) -> FieldMatcher:
    """What a list of a pattern says; `count` is called for every value that it takes, by its path."""
    if not entries:
        raise PatternError(path, "an empty list matches nothing: name a value, or null or [{'exists': false}]")
    exact, others, exists = set(), [], set()
    for number, entry in enumerate(entries):
        here = f"{path}[{number}]"
        count(here, 1)
        if not isinstance(entry, Mapping):
            exact.add(_scalar(entry, here))
        elif len(entry) != 1:
            raise PatternError(here, f"one operator an entry, not {len(entry)}: {_known()}")
        else:
            ((name, value),) = entry.items()
            here = f"{here}.{str(name)[:40]}"
            if name == "exists":
                exists.add(_boolean(value, here))
            elif name not in OPERATORS:
                raise PatternError(here, f"there is no such operator; there are {_known()}")
            else:
                count(here, len(value) if isinstance(value, list) else 0)
                others.append(OPERATORS[name](value, here))
    return FieldMatcher(exact=frozenset(exact), others=tuple(others), present=True in exists, absent=False in exists)


def _known() -> str:
    return ", ".join([*OPERATORS, "exists"])


def _scalar(value: Any, path: str) -> Key:
    if value is None or isinstance(value, str | bool) or is_number(value):
        return key_of(value)
    raise PatternError(path, "an entry is a text, a number, true, false, null, or an operator like {'prefix': 'a'}")


def _boolean(value: Any, path: str) -> bool:
    if not isinstance(value, bool):
        raise PatternError(path, "is true or false")
    return value


def _text(value: Any, path: str) -> str:
    if not isinstance(value, str):
        raise PatternError(path, "is a text")
    return value


def _fold(value: Any, path: str) -> Folded:
    return Folded(_text(value, path).lower())


def _prefix(value: Any, path: str) -> Prefix:
    text, fold = _maybe_folded(value, path)
    return Prefix(text, fold)


def _suffix(value: Any, path: str) -> Suffix:
    text, fold = _maybe_folded(value, path)
    return Suffix(text, fold)


def _maybe_folded(value: Any, path: str) -> tuple[str, bool]:
    if isinstance(value, Mapping) and list(value) == [FOLD]:
        return _text(value[FOLD], f"{path}.{FOLD}").lower(), True
    if not isinstance(value, str):
        raise PatternError(path, f"is a text, or {{'{FOLD}': text}}")
    return value, False


def _like(value: Any, path: str) -> Like:
    return Like(read_wildcard(_text(value, path), path))


def _block(value: Any, path: str) -> InBlock:
    return InBlock(read_block(_text(value, path), path))


def _anything_but(value: Any, path: str) -> AnythingBut:
    if isinstance(value, Mapping):
        if len(value) != 1 or (name := next(iter(value))) not in _REFUSABLE:
            raise PatternError(path, f"refuses values, or one of {', '.join(_REFUSABLE)}")
        refused = value[name] if isinstance(value[name], list) else [value[name]]
        if not refused:
            raise PatternError(f"{path}.{name}", "an empty list refuses nothing")
        read = _REFUSABLE[name]
        return AnythingBut(tuple(read(item, f"{path}.{name}") for item in refused))
    values = value if isinstance(value, list) else [value]
    if not values or not (all(map(is_number, values)) or all(isinstance(item, str) for item in values)):
        raise PatternError(path, "refuses a text or a number, or a list of texts or of numbers")
    return AnythingBut((Exact(frozenset(values)),))


_REFUSABLE: dict[str, Callable[[Any, str], Prefix | Suffix | Folded | Like]] = {
    "prefix": _prefix,
    "suffix": _suffix,
    "wildcard": _like,
    FOLD: _fold,
}
OPERATORS: dict[str, Callable[[Any, str], Condition]] = {
    "prefix": _prefix,
    "suffix": _suffix,
    FOLD: _fold,
    "wildcard": _like,
    "anything-but": _anything_but,
    "numeric": read_span,
    "cidr": _block,
}
