"""The document as JSON Schema (2020-12): for the docs, for editors, and for the dashboard's forms."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from metaros.fleet.twin.fields import Key, Parameters
from metaros.fleet.twin.tables import KINDS_OF_NODE, LIFECYCLE_STATES, MAX_NODES, MAX_ROWS, SECTIONS

__all__ = ["json_schema"]


def json_schema() -> dict[str, Any]:
    """What `parse` takes, but for the rules between keys of different rows (`after`, the count of all rows)."""
    properties = {name: {"description": item.meaning, **_section(name)} for name, item in SECTIONS.items()}
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "A robot's twin",
        "type": "object",
        "properties": properties,
        "additionalProperties": False,
    }


def _section(name: str) -> dict[str, Any]:
    section = SECTIONS[name]
    if section.names is None:
        return _row(section.keys or {})
    most = MAX_NODES if name == "nodes" else MAX_ROWS
    row: dict[str, Any]
    if section.keys is not None:
        row = _row(section.keys)
    elif name == "parameters":
        row = Parameters().schema()
    else:
        row = {"enum": list(LIFECYCLE_STATES)}
    if name == "nodes":
        row["oneOf"] = [{"required": [word]} for word in KINDS_OF_NODE]
        row["dependentRequired"] = {"bundle": ["version"], "version": ["bundle"]}
    return {
        "type": "object",
        "maxProperties": most,
        "propertyNames": section.names.schema(),
        "additionalProperties": row,
    }


def _row(keys: Mapping[str, Key]) -> dict[str, Any]:
    properties = {
        name: {"description": key.meaning, "default": _plain(key.default), **key.kind.schema()}
        for name, key in keys.items()
    }
    return {"type": "object", "properties": properties, "additionalProperties": False}


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value
