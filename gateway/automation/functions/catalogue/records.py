"""The catalogue's records: all of them in memory for reading, and a draft of them inside a transaction for changing."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Protocol

from gateway.store.automation import functions as rows
from gateway.store.automation.functions import Record
from gateway.store.engine import StoreEngine

__all__ = [
    "ALIAS",
    "ASYNC",
    "FUNCTION",
    "LAYER",
    "LAYER_GONE",
    "LAYER_NAME",
    "MAPPING",
    "POLICY",
    "PROVISIONED",
    "VERSION",
    "Draft",
    "RecordCache",
    "Records",
]

# What a record is. Its owner is the function's or the layer's name; its id what is said here.
FUNCTION = "function"  # "$LATEST": the settings that are being worked on
VERSION = "version"  # its number: a copy that never changes
ALIAS = "alias"  # its name
ASYNC = "async"  # a qualifier, "$LATEST" for none: what becomes of events
PROVISIONED = "provisioned"  # a version's number or an alias' name: how many workers are kept warm
POLICY = "policy"  # a qualifier, "" for none: who may call it, which is kept and shown
MAPPING = "mapping"  # its UUID: an event source
LAYER = "layer"  # its version's number
LAYER_GONE = "layer_gone"  # the same after its deletion, as long as a function has it
LAYER_NAME = "layer_name"  # "": the next version's number


class Records(Protocol):
    """What a question needs, in memory or in a transaction."""

    def get(self, kind: str, owner: str, record_id: str) -> Record | None:
        """One record."""

    def all(self, kind: str, owner: str | None = None) -> list[Record]:
        """Those of a kind, of one owner or of all; by owner, then by id."""


class RecordCache:
    """Every record as it was committed last."""

    def __init__(self, records: Iterable[Record] = ()) -> None:
        self._kinds: dict[str, dict[str, dict[str, Record]]] = {}
        for record in records:
            self._put(record)

    def get(self, kind: str, owner: str, record_id: str) -> Record | None:
        """One record."""
        return self._kinds.get(kind, {}).get(owner, {}).get(record_id)

    def all(self, kind: str, owner: str | None = None) -> list[Record]:
        """Those of a kind, of one owner or of all."""
        owners = self._kinds.get(kind, {})
        names = sorted(owners) if owner is None else [owner]
        return [record for name in names for _, record in sorted(owners.get(name, {}).items())]

    def apply(self, draft: Draft) -> None:
        """Take over what a draft has committed."""
        for record in draft.changed:
            self._put(record)
        for kind, owner, record_id in draft.removed:
            self._kinds.get(kind, {}).get(owner, {}).pop(record_id, None)

    def _put(self, record: Record) -> None:
        self._kinds.setdefault(record.kind, {}).setdefault(record.owner, {})[record.id] = record


class Draft:
    """The records inside one transaction of the writer's, which it has for itself; notes what it changes."""

    def __init__(self, engine: StoreEngine, *, now_ns: int) -> None:
        self.engine = engine
        self.now_ns = now_ns
        self.change = rows.next_change(engine)
        self._put: dict[tuple[str, str, str], Record] = {}
        self._removed: set[tuple[str, str, str]] = set()

    def get(self, kind: str, owner: str, record_id: str) -> Record | None:
        """One record."""
        return rows.get_record(self.engine, kind, owner, record_id)

    def all(self, kind: str, owner: str | None = None) -> list[Record]:
        """Those of a kind, of one owner or of all."""
        return rows.list_records(self.engine, kind, owner)

    def put(self, record: Record) -> Record:
        """Add or replace one; it is what is given back."""
        rows.put_record(self.engine, record)
        key = (record.kind, record.owner, record.id)
        self._put[key] = record
        self._removed.discard(key)
        return record

    def remove(self, record: Record) -> None:
        """Take one away."""
        rows.remove_record(self.engine, record.kind, record.owner, record.id)
        key = (record.kind, record.owner, record.id)
        self._put.pop(key, None)
        self._removed.add(key)

    @property
    def changed(self) -> Iterator[Record]:
        """What was added or replaced."""
        return iter(self._put.values())

    @property
    def removed(self) -> Iterator[tuple[str, str, str]]:
        """The kind, owner and id of what was taken away."""
        return iter(self._removed)

    @property
    def owners(self) -> set[str]:
        """Whose records changed."""
        return {owner for _, owner, _ in (*self._put, *self._removed)}

    @property
    def kinds(self) -> set[str]:
        """Of which kinds."""
        return {kind for kind, _, _ in (*self._put, *self._removed)}
