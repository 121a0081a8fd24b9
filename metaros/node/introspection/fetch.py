"""Fetches types that this program does not know from nodes that use them, by ROS 2's `~/get_type_description`.

What a peer tells is believed only if it leads to the hash in the peer's own token.
"""

from __future__ import annotations

import asyncio
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, Final

from metaros.errors import MetarosError, TypeHashError, UnknownTypeError
from metaros.idl import (
    Catalogue,
    Definition,
    Field,
    FieldType,
    MessageDefinition,
    catalogue_of,
    default_catalogue,
    definition_text,
    message_class,
    parse_definition,
    remember,
)
from metaros.limits import LIMITS
from metaros.node.client import Client, make_client
from metaros.node.core import NodeCore
from metaros.node.introspection.type_description import SERVICE

__all__ = ["fetch_type", "fetch_type_async", "users_of"]

TIMEOUT_S: Final = 5.0
_LOOK_S: Final = 0.05
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


def fetch_type(node: NodeCore, type_name: str, type_hash: str, *, timeout_s: float = TIMEOUT_S) -> Catalogue:
    """The catalogue that has the type with that very hash: the program's own, or what a node in the graph answers.

    Blocks up to `timeout_s` for each node that uses the type. `UnknownTypeError` says whom it asked and what came;
    so do not call it on the executor that would have to answer.
    """
    known = catalogue_of(type_name, type_hash)
    if known is not None:
        return known
    problems = []
    for user in users_of(node, type_name, type_hash):
        try:
            with _client(node, user) as client:
                client.wait_for_service(timeout_s)
                return _learn(type_name, type_hash, client.call(_request(type_name, type_hash), timeout_s))
        except MetarosError as error:
            problems.append(f"{user}: {error}")
    raise _unknown(type_name, type_hash, problems)


async def fetch_type_async(
    node: NodeCore, type_name: str, type_hash: str, *, timeout_s: float = TIMEOUT_S
) -> Catalogue:
    """The same for coroutines."""
    known = catalogue_of(type_name, type_hash)
    if known is not None:
        return known
    problems = []
    for user in users_of(node, type_name, type_hash):
        try:
            with _client(node, user) as client:
                for _ in range(round(timeout_s / _LOOK_S)):
                    if client.service_is_ready():
                        break
                    await asyncio.sleep(_LOOK_S)  # its token comes a moment after that of the topic
                return _learn(type_name, type_hash, await client.call_async(_request(type_name, type_hash), timeout_s))
        except MetarosError as error:
            problems.append(f"{user}: {error}")
    raise _unknown(type_name, type_hash, problems)


def users_of(node: NodeCore, type_name: str, type_hash: str) -> list[str]:
    """The full names of the nodes that have endpoints of that type, publishers first."""
    ends = [item for item in node.graph.endpoints() if (item.type_name, item.type_hash) == (type_name, type_hash)]
    ends.sort(key=lambda item: item.kind != "MP")
    own = (node.context.zid, node.full_name)
    return list(dict.fromkeys(item.node_full_name for item in ends if (item.zid, item.node_full_name) != own))


def _client(node: NodeCore, user: str) -> Client:
    from metaros.interfaces.type_description_interfaces.srv import GetTypeDescription

    return make_client(node, GetTypeDescription, f"{user}/{SERVICE.name}")


def _request(type_name: str, type_hash: str) -> Any:
    request = message_class(f"{SERVICE.type_name}_Request")
    return request(type_name=type_name, type_hash=type_hash, include_type_sources=True)


def _unknown(type_name: str, type_hash: str, problems: list[str]) -> UnknownTypeError:
    asked = "\n".join(problems) or "no node that uses it is in the graph to be asked"
    return UnknownTypeError(f"{type_name} with the hash {type_hash} is not in the catalogue\n{asked}")


def _learn(type_name: str, type_hash: str, response: Any) -> Catalogue:
    """A catalogue of what was answered: from the sources if they suffice, else from the described fields."""
    if not response.successful:
        raise UnknownTypeError(str(response.failure_reason)[:400])
    described = response.type_description
    parts = [described.type_description, *described.referenced_type_descriptions]
    if len(parts) > LIMITS.type_cache:
        raise UnknownTypeError(f"a type of {len(parts)} parts")
    for definitions in (_sources(response.type_sources), _definitions(parts), _with_service(type_name, parts)):
        catalogue = Catalogue(base=default_catalogue())
        try:
            found = list(definitions)
            catalogue.add_all([item for item in found if not _is_ours(item)])
            remember(type_name, catalogue.home(type_name), hash_text=type_hash)
            return catalogue.home(type_name)
        except (MetarosError, ValueError):
            continue
    raise TypeHashError(f"what the node says of {type_name} does not lead to the hash {type_hash}")


def _is_ours(definition: Definition) -> bool:
    return definition.name in default_catalogue() and default_catalogue().get(definition.name) == definition


def _sources(sources: Iterable[Any]) -> Iterator[Definition]:
    """The .msg texts, which have constants and defaults beside the fields."""
    for source in sources:
        definition = parse_definition(source.raw_file_contents, source.type_name)
        if source.encoding != "msg" or not isinstance(definition, MessageDefinition):
            raise UnknownTypeError(f"a source in {source.encoding!r}")
        yield definition


def _definitions(parts: Iterable[Any]) -> Iterator[Definition]:
    for part in parts:
        # What a peer names becomes code here: let only what the grammar allows pass.
        yield parse_definition(_text(part), part.type_name)


def _with_service(name: str, parts: Sequence[Any]) -> Iterator[Definition]:
    """A service from its described halves, with the messages that it is made of."""
    by_name = {part.type_name: part for part in parts}
    halves = [by_name[f"{name}_{half}"] for half in ("Request", "Response") if f"{name}_{half}" in by_name]
    if len(halves) != 2:
        raise UnknownTypeError(f"{name} is described without its halves")
    yield parse_definition("---\n".join(_text(part) for part in halves), name)
    yield from _definitions(part for part in parts if "/msg/" in part.type_name)


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
