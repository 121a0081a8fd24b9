"""What differs between two documents, key by key, for people and for the gateway's answers."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, Final

from metaros.fleet.twin.merge import same

__all__ = ["ABSENT", "Change", "apply", "diff"]

SHOWN_CHARS: Final = 60


class _Absent:
    """The value of a key that is not there; null is a value."""

    def __repr__(self) -> str:
        return "ABSENT"

    def __deepcopy__(self, memo: Any) -> _Absent:
        return self


ABSENT: Final = _Absent()


@dataclass(frozen=True, slots=True)
class Change:
    """One difference. `path` is a JSON pointer (RFC 6901); `old` or `new` is ABSENT where the key is not there."""

    path: str
    old: Any
    new: Any

    @property
    def verb(self) -> str:
        """add, remove or change."""
        return "add" if self.old is ABSENT else "remove" if self.new is ABSENT else "change"

    @property
    def text(self) -> str:
        """One line: `~ /nodes/lidar/nice: 0 → 5`."""
        if self.old is ABSENT:
            return f"+ {self.path}: {_shown(self.new)}"
        if self.new is ABSENT:
            return f"- {self.path}: {_shown(self.old)}"
        return f"~ {self.path}: {_shown(self.old)} → {_shown(self.new)}"

    def as_json(self) -> dict[str, Any]:
        """The change as the API shows it."""
        sides = {name: value for name, value in (("old", self.old), ("new", self.new)) if value is not ABSENT}
        return {"path": self.path, "verb": self.verb, **sides}


def diff(old: Any, new: Any) -> list[Change]:
    """The changes from `old` to `new`, by path. Objects are compared key by key; lists and all else as a whole."""
    return list(_walk(old, new, ""))


def apply(document: Any, changes: Iterable[Change]) -> Any:
    """`document` with the changes made: `apply(a, diff(a, b))` is `b`. Only what it changes is copied."""
    found = document
    for change in changes:
        keys = [key.replace("~1", "/").replace("~0", "~") for key in change.path.split("/")[1:]]
        found = _put(found, keys, change.new)
    return found


def _walk(old: Any, new: Any, path: str) -> Iterator[Change]:
    if not isinstance(old, dict) or not isinstance(new, dict):
        if not same(old, new):
            yield Change(path, old, new)
        return
    for key in sorted(old.keys() | new.keys()):
        below = f"{path}/{key.replace('~', '~0').replace('/', '~1')}"
        yield from _walk(old.get(key, ABSENT), new.get(key, ABSENT), below)


def _put(document: Any, keys: list[str], value: Any) -> Any:
    if not keys:
        return value
    found = dict(document)
    if len(keys) == 1 and value is ABSENT:
        found.pop(keys[0], None)
    else:
        found[keys[0]] = _put(found.get(keys[0]), keys[1:], value)
    return found


def _shown(value: Any) -> str:
    text = json.dumps(value, ensure_ascii=False, sort_keys=True)
    return text if len(text) <= SHOWN_CHARS else f"{text[: SHOWN_CHARS - 1]}…"
