"""RIHS01, the hash of ROS 2 that tells whether two sides mean the same interface by one name."""

from __future__ import annotations

import hashlib
import json
import re
from typing import Any

from metaros.errors import DefinitionError
from metaros.idl.catalogue import Catalogue, default_catalogue
from metaros.idl.definitions import FieldType, MessageDefinition
from metaros.idl.derived import whole_message

__all__ = ["PLACEHOLDER_FIELD", "parse_hash", "type_description", "type_hash"]

PLACEHOLDER_FIELD = "structure_needs_at_least_one_member"

_TYPE_IDS = {
    "int8": 2,
    "uint8": 3,
    "char": 3,
    "int16": 4,
    "uint16": 5,
    "int32": 6,
    "uint32": 7,
    "int64": 8,
    "uint64": 9,
    "float32": 10,
    "float64": 11,
    "bool": 15,
    "byte": 16,
    "string": 17,
    "wstring": 18,
}
_NESTED_ID = 1
_BOUNDED_TEXT = 4  # 17 -> 21, 18 -> 22
_ARRAY_OFFSETS = {"": 0, "fixed": 48, "bounded": 96, "unbounded": 144}
_HASH = re.compile(r"RIHS01_[0-9a-f]{64}\Z")


def type_hash(name: str, catalogue: Catalogue | None = None) -> str:
    """The "RIHS01_…" hash of a message, service, action or any interface derived from them."""
    home = (catalogue or default_catalogue()).home(name)
    return home.memo("hash", name, lambda: _hash(name, home))


def type_description(name: str, catalogue: Catalogue | None = None) -> dict[str, Any]:
    """The type description that is hashed: also what a `get_type_description` service answers with."""
    home = (catalogue or default_catalogue()).home(name)
    return {
        "type_description": _description(name, home),
        "referenced_type_descriptions": [_description(part, home) for part in home.dependencies(name)],
    }


def parse_hash(text: str) -> bytes:
    """The 32 bytes of a "RIHS01_…" text, or `DefinitionError`."""
    if not _HASH.match(text):
        raise DefinitionError(f"{text[:80]!r} is no RIHS01 hash: RIHS01_ and 64 lower-case hexadecimal digits")
    return bytes.fromhex(text[7:])


def _hash(name: str, catalogue: Catalogue) -> str:
    text = json.dumps(type_description(name, catalogue))
    return "RIHS01_" + hashlib.sha256(text.encode("ascii")).hexdigest()


def _description(name: str, catalogue: Catalogue) -> dict[str, Any]:
    definition = catalogue.get(name)
    if not isinstance(definition, MessageDefinition):
        definition = whole_message(definition)
    fields = [{"name": field.name, "type": _field_type(field.type)} for field in definition.fields]
    if not fields:
        fields = [{"name": PLACEHOLDER_FIELD, "type": _field_type(FieldType("uint8"))}]
    return {"type_name": name, "fields": fields}


def _field_type(kind: FieldType) -> dict[str, Any]:
    type_id = _NESTED_ID if kind.is_nested else _TYPE_IDS[kind.base]
    if kind.string_bound:
        type_id += _BOUNDED_TEXT
    return {
        "type_id": type_id + _ARRAY_OFFSETS[kind.array],
        "capacity": kind.capacity,
        "string_capacity": kind.string_bound,
        "nested_type_name": kind.base if kind.is_nested else "",
    }
