"""The schema text of a type: from the catalogue when it has that very hash, else from a node that publishes it."""

from __future__ import annotations

from typing import Final

from metaros.errors import MetarosError
from metaros.idl import catalogue_of, schema_text
from metaros.limits import LIMITS
from metaros.node import Node
from metaros.node.introspection import fetch_type

__all__ = ["find_schema", "known_schema"]

_ASK_S: Final = 2.0


def known_schema(type_name: str, wanted_hash: str) -> str:
    """The text of a type that this program knows under that very hash (Humble tells none), else empty."""
    try:
        catalogue = catalogue_of(type_name, wanted_hash)
        return "" if catalogue is None else schema_text(type_name, catalogue)
    except MetarosError:
        return ""


def find_schema(node: Node, type_name: str, wanted_hash: str, *, timeout_s: float = _ASK_S) -> tuple[str, str]:
    """The text and, where there is none, why. It may ask nodes of the graph: call it on a thread of its own."""
    text = known_schema(type_name, wanted_hash)
    if not text:
        try:
            text = schema_text(type_name, fetch_type(node, type_name, wanted_hash, timeout_s=timeout_s))
        except MetarosError as error:
            return "", str(error).replace("\n", ": ")
    if len(text.encode()) > LIMITS.schema_bytes:
        return "", f"its schema is longer than {LIMITS.schema_bytes} bytes"
    return text, ""
