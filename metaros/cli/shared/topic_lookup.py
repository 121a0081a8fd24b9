"""Topic lookup by name: its type, hash and a QoS that fits its publishers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from metaros.cli.shared.connection import absolute, closest
from metaros.cli.shared.types import expand, full_type
from metaros.errors import MetarosError, TypeHashError, UnavailableError, UnknownTypeError, UsageError

if TYPE_CHECKING:
    from metaros.idl import Catalogue
    from metaros.node import Context
    from metaros.wire import EndpointInfo, QoSProfile

__all__ = ["FoundTopic", "find_topic"]

_ASK_S = 2.0  # for each node that is asked what its type is


@dataclass(frozen=True, slots=True)
class FoundTopic:
    """A topic in the graph; `catalogue` has its type, where that is not the shipped one, unless only bytes matter."""

    name: str
    type_name: str
    type_hash: str
    qos: QoSProfile
    catalogue: Catalogue | None = None


def find_topic(context: Context, topic: str, type_name: str = "", *, spin_time: float, raw: bool = False) -> FoundTopic:
    """Look `topic` up, waiting up to `spin_time` for it; `type_name` chooses where several types share the name.

    Unless `raw`, its definition is needed: that of the catalogue, if the hash is the publishers', else theirs.
    """
    from metaros.wire.matching import reading_qos

    name = absolute(topic)
    wanted = expand(type_name) if type_name else ""
    context.graph.wait_for(lambda: bool(_matching(context, name, wanted)), spin_time)
    if spin_time > 0:
        context.graph.settle(spin_time)  # its other publishers, of other types perhaps
    ends = _matching(context, name, wanted)
    if not ends:
        if wanted:  # nobody yet: listen all the same
            wanted = full_type(type_name)
            return FoundTopic(name, wanted, _own_hash(wanted), reading_qos([]))
        known = list(context.graph.topics())
        hint = closest(name, known) or "`metaros topic list` shows those there are; with a TYPE it waits for one"
        raise UnavailableError(f"no topic {name!r} in the graph\n{hint}")
    types = sorted({item.type_name for item in ends})
    if len(types) > 1:
        raise UsageError(f"{name} has several types: {', '.join(types)}\nname one: metaros topic … {name} {types[0]}")
    publishers = [item for item in ends if item.kind == "MP"] or ends
    type_hash = publishers[0].type_hash
    catalogue = None if raw else _definition(context, name, types[0], type_hash)
    return FoundTopic(name, types[0], type_hash, reading_qos([item.qos for item in publishers]), catalogue)


def _matching(context: Context, name: str, wanted: str) -> list[EndpointInfo]:
    ends = context.graph.endpoints(topic=name)
    return [item for item in ends if item.kind in ("MP", "MS") and wanted in ("", item.type_name)]


def _own_hash(type_name: str) -> str:
    from metaros.idl import type_hash

    return type_hash(type_name)


def _definition(context: Context, topic: str, type_name: str, type_hash: str) -> Catalogue:
    """The catalogue with that very type: ours, or what a node of the topic tells."""
    from metaros.idl import catalogue_of, default_catalogue
    from metaros.node import Node
    from metaros.node.introspection import fetch_type

    known = catalogue_of(type_name, type_hash)
    if known is not None:
        return known
    try:
        with Node("metaros_cli_types", context=context, enable_rosout=False, enable_parameters=False) as node:
            return fetch_type(node, type_name, type_hash, timeout_s=_ASK_S)
    except MetarosError as error:
        reason = str(error).partition("\n")[2] or str(error)
    if type_name not in default_catalogue():
        raise UnknownTypeError(
            f"{topic} has the type {type_name}, which the catalogue does not know\n{reason}\nuse --raw to see the bytes"
        )
    raise TypeHashError(
        f"{topic}: its publisher's {type_name} differs from ours\n"
        f"publisher {type_hash}\nours      {_own_hash(type_name)}\n{reason}\nuse --raw to see the bytes"
    )
