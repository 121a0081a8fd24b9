"""What a node tells of its types as definitions, believed only where they lead to the hashes in its tokens. Pure."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, Final

from metaros.cdr.layout import check_size
from metaros.errors import MetarosError, TypeHashError, UnknownTypeError
from metaros.idl import (
    Catalogue,
    Definition,
    Field,
    FieldType,
    MessageDefinition,
    default_catalogue,
    definition_text,
    parse_definition,
    parse_msg,
    remember,
    type_hash,
)
from metaros.idl.derived import root_names
from metaros.limits import LIMITS

__all__ = ["ACTION_PARTS", "learn", "learn_action", "remember_action"]

ACTION_PARTS: Final = ("_SendGoal", "_GetResult", "_FeedbackMessage")  # what of an action stands in tokens
_INNER: Final = {"_SendGoal": "_Goal", "_GetResult": "_Result", "_FeedbackMessage": "_Feedback"}
_BASES: Final = {
    **dict(enumerate(("int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64", "float32"), start=2)),
    11: "float64",
    13: "char",
    15: "bool",
    16: "byte",
    17: "string",
    18: "wstring",
    21: "string",
    22: "wstring",
}
_ARRAYS: Final = ("", "fixed", "bounded", "unbounded")
_PLACEHOLDER: Final = "structure_needs_at_least_one_member"


def learn(name: str, wanted_hash: str, response: Any) -> Catalogue:
    """A catalogue with `name` of what `~/get_type_description` answered, remembered under its hash.

    The sources are taken if they suffice, for their constants and defaults, else the described fields.
    UnknownTypeError where the node does not tell, TypeHashError where what it tells has another hash, DefinitionError
    where that is a type whose mere instances would fill the memory, or that nests too deep.
    """
    parts = _parts(response)
    for definitions in (lambda: _sources(response.type_sources), lambda: _described(parts)):
        try:
            catalogue = _catalogue(definitions)
            if type_hash(name, catalogue) != wanted_hash:
                continue
        except (MetarosError, ValueError):
            continue
        check_size(name, catalogue)
        remember(name, catalogue.home(name))
        return catalogue.home(name)
    raise TypeHashError(f"what the node says of {name} does not lead to the hash {wanted_hash}")


def learn_action(name: str, hashes: Mapping[str, str], responses: Mapping[str, Any]) -> Catalogue:
    """A catalogue with the action `name` of what was answered about its `ACTION_PARTS`, all of which must be right.

    `hashes` and `responses` are by part. It is remembered under its own name and those of its parts.
    """
    described: dict[str, Any] = {}
    for response in responses.values():
        described.update((part.type_name, part) for part in _parts(response))
    texts = []
    for part in ACTION_PARTS:
        inner = f"{name}{_INNER[part]}"
        if inner not in described:
            raise UnknownTypeError(f"{name}{part} is described without {inner}")
        texts.append(_text(described[inner]))

    def definitions() -> Iterator[Definition]:
        yield parse_definition("---\n".join(texts), name)
        yield from _described([part for part in described.values() if "/msg/" in part.type_name])

    try:
        catalogue = _catalogue(definitions)
        actual = {part: type_hash(name + part, catalogue) for part in ACTION_PARTS}
    except ValueError as error:
        raise TypeHashError(f"what the node says of {name} is no definition: {error}") from None
    for part in ACTION_PARTS:
        if actual[part] != hashes[part]:
            raise TypeHashError(f"what the node says of {name}{part} does not lead to the hash {hashes[part]}")
    check_size(name, catalogue)
    remember_action(name, catalogue)
    return catalogue.home(name)


def remember_action(name: str, catalogue: Catalogue) -> None:
    """Let `catalogue_of` find an action and its parts."""
    for part in ("", *ACTION_PARTS):
        remember(name + part, catalogue.home(name))


def _parts(response: Any) -> list[Any]:
    if not response.successful:
        raise UnknownTypeError(str(response.failure_reason)[:400] or "it does not tell")
    described = response.type_description
    parts = [described.type_description, *described.referenced_type_descriptions]
    if len(parts) > LIMITS.type_cache:
        raise UnknownTypeError(f"a type of {len(parts)} parts")
    return parts


def _catalogue(definitions: Callable[[], Iterable[Definition]]) -> Catalogue:
    catalogue = Catalogue(base=default_catalogue())
    catalogue.add_all([item for item in definitions() if not _is_ours(item)])
    return catalogue


def _is_ours(definition: Definition) -> bool:
    return definition.name in default_catalogue() and default_catalogue().get(definition.name) == definition


def _sources(sources: Iterable[Any]) -> Iterator[Definition]:
    """The files' texts, which have constants and defaults beside the fields; parts of services have none."""
    for source in sources:
        if source.encoding == "implicit" and any(root_names(source.type_name)):
            continue
        if source.encoding != source.type_name.split("/")[1]:
            raise UnknownTypeError(f"a source in {source.encoding!r}")
        yield parse_definition(source.raw_file_contents, source.type_name)


def _described(parts: Sequence[Any]) -> Iterator[Definition]:
    """Messages by their fields, services by their halves, other parts of services and actions as messages.

    What a peer names becomes code here: let only what the grammar allows pass, which the parser knows.
    """
    by_name = {part.type_name: part for part in parts}
    services = {
        name.removesuffix("_Request")
        for name in by_name
        if "/srv/" in name and name.endswith("_Request") and f"{name.removesuffix('_Request')}_Response" in by_name
    }
    for name in sorted(services):
        halves = (by_name[f"{name}_{half}"] for half in ("Request", "Response"))
        yield parse_definition("---\n".join(_text(half) for half in halves), name)
    for name, part in by_name.items():
        if name not in services and not services.intersection(root_names(name)):
            yield parse_msg(_text(part), name)


def _text(part: Any) -> str:
    """What a described message's file would say."""
    fields = tuple(Field(field.name, _field_type(field.type)) for field in part.fields)
    if len(fields) == 1 and fields[0].name == _PLACEHOLDER:
        fields = ()
    return definition_text(MessageDefinition(part.type_name, fields))


def _field_type(described: Any) -> FieldType:
    array, base_id = divmod(int(described.type_id), 48)
    base = described.nested_type_name if base_id == 1 else _BASES.get(base_id)
    if not base or array >= len(_ARRAYS):
        raise UnknownTypeError(f"the field type {described.type_id} has no message form")
    return FieldType(base, _ARRAYS[array], int(described.capacity), int(described.string_capacity))
