"""The schema text of a type: from the catalogue when it has that very hash, else from a node that publishes it.

A node of another program is asked by ROS 2's own `~/get_type_description`. Its sources are taken when they lead to the
announced hash; otherwise the text is written anew from the fields that it describes.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

from metaros.errors import MetarosError
from metaros.idl import (
    Catalogue,
    Field,
    FieldType,
    MessageDefinition,
    add_schema_text,
    default_catalogue,
    definition_text,
    schema_text,
    type_hash,
)
from metaros.interfaces.type_description_interfaces.srv import GetTypeDescription
from metaros.limits import LIMITS
from metaros.node import Node

__all__ = ["SchemaFinder", "known_schema"]

_ASK_S: Final = 2.0
_SEPARATOR: Final = "=" * 80
_UNHASHED: Final = "TypeHashNotSupported"  # what Humble writes
_NAMES: Final = {
    2: "int8",
    3: "uint8",
    4: "int16",
    5: "uint16",
    6: "int32",
    7: "uint32",
    8: "int64",
    9: "uint64",
    10: "float32",
    11: "float64",
    13: "char",
    15: "bool",
    16: "byte",
    17: "string",
    18: "wstring",
    21: "string",
    22: "wstring",
}
_ARRAYS: Final = {0: "", 48: "fixed", 96: "bounded", 144: "unbounded"}


def known_schema(type_name: str, wanted_hash: str) -> str:
    """The text of a type that the catalogue has under that very hash, else empty."""
    try:
        if type_name in default_catalogue() and wanted_hash in (type_hash(type_name), _UNHASHED):
            return schema_text(type_name)
    except MetarosError:
        pass
    return ""


class SchemaFinder:
    """Asks nodes of the graph. `find` blocks: call it on a thread of its own."""

    def __init__(self, node: Node, *, timeout_s: float = _ASK_S) -> None:
        self._node = node
        self._timeout_s = timeout_s
        self._found: dict[tuple[str, str], str] = {}

    def find(self, type_name: str, wanted_hash: str, nodes: Sequence[str]) -> tuple[str, str]:
        """The schema text and, where there is none, why."""
        text = known_schema(type_name, wanted_hash) or self._found.get((type_name, wanted_hash), "")
        reason = "its publisher is gone"
        for name in () if text else nodes:
            text, reason = self._ask(name, type_name, wanted_hash)
            if text:
                break
        if text and len(self._found) < LIMITS.type_cache:
            self._found[type_name, wanted_hash] = text
        return text, "" if text else reason

    def _ask(self, node_name: str, type_name: str, wanted_hash: str) -> tuple[str, str]:
        request = GetTypeDescription.Request(type_name=type_name, type_hash=wanted_hash, include_type_sources=True)
        try:
            with self._node.create_client(GetTypeDescription, f"{node_name}/get_type_description") as client:
                answer = client.call(request, timeout_s=self._timeout_s)
            if not answer.successful:
                return "", f"{node_name}: {answer.failure_reason}"
            text = _from_sources(type_name, wanted_hash, answer) or _from_fields(type_name, wanted_hash, answer)
        except MetarosError as error:
            return "", f"{node_name}: {error}"
        return text, "" if text else f"{node_name} describes another {type_name} than it publishes"


def _from_sources(type_name: str, wanted_hash: str, answer: Any) -> str:
    """The sources as the publisher has them, comments and all, when they are .msg texts of the right hash."""
    texts = {source.type_name: source.raw_file_contents for source in answer.type_sources if source.encoding == "msg"}
    if type_name not in texts:
        return ""
    parts = [texts.pop(type_name).rstrip("\n")]
    parts += [f"{_SEPARATOR}\nMSG: {_title(name)}\n{text.rstrip()}" for name, text in sorted(texts.items())]
    text = "\n".join(parts) + "\n"
    return text if _has_hash(type_name, wanted_hash, text) else ""


def _from_fields(type_name: str, wanted_hash: str, answer: Any) -> str:
    """The text written from the described fields."""
    description = answer.type_description
    parts = {description.type_description.type_name: description.type_description}
    parts |= {part.type_name: part for part in description.referenced_type_descriptions}
    if type_name not in parts:
        return ""
    text = definition_text(_definition(parts.pop(type_name)))
    for name, part in sorted(parts.items()):
        text += f"{_SEPARATOR}\nMSG: {_title(name)}\n{definition_text(_definition(part))}"
    return text if _has_hash(type_name, wanted_hash, text) else ""


def _has_hash(type_name: str, wanted_hash: str, text: str) -> bool:
    if len(text.encode()) > LIMITS.schema_bytes:
        return False
    catalogue = Catalogue(base=default_catalogue())
    try:
        add_schema_text(type_name, text, catalogue)
        return wanted_hash in (type_hash(type_name, catalogue), _UNHASHED)
    except MetarosError:
        return False


def _definition(part: Any) -> MessageDefinition:
    fields = [Field(item.name, _field_type(item.type)) for item in part.fields]
    if [item.name for item in fields] == ["structure_needs_at_least_one_member"]:
        fields = []
    return MessageDefinition(part.type_name, tuple(fields))


def _field_type(described: Any) -> FieldType:
    for offset, array in _ARRAYS.items():
        base = described.nested_type_name if described.type_id - offset == 1 else _NAMES.get(described.type_id - offset)
        if base and 0 < described.type_id - offset < 48:
            return FieldType(base, array, described.capacity, described.string_capacity)
    raise _no_type(described)


def _no_type(described: Any) -> MetarosError:
    return MetarosError(f"a field of type number {described.type_id}, which no .msg can say")


def _title(name: str) -> str:
    package, kind, short = name.split("/")
    return f"{package}/{short}" if kind == "msg" else name
