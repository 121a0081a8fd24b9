"""JSON-able values as CDR and back, by a catalogue that is known: for what robots' graphs name."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from gateway.errors import InvalidRequestError
from gateway.fleet.ros.graph import RobotGraph
from metaros.cdr import codec
from metaros.cdr.layout import check_size, least_bytes
from metaros.errors import TypeHashError, UnknownTypeError
from metaros.idl import Catalogue, default_catalogue, message_class
from metaros.idl.json import from_json, to_json
from metaros.limits import LIMITS

__all__ = ["LARGE_BYTES", "catalogue_for", "decode", "encode", "is_large"]

LARGEST = LIMITS.frame_bytes // 2
LARGE_BYTES = 32 * 1024  # beyond it, encoding runs in a thread: the event loop never stops for 5 ms
ITEM_BYTES = 8  # that an element of a list or a field counts for, beside its text


def is_large(value: Any) -> bool:
    """Whether a JSON-able message is one to encode in a thread; looks no further than it has to for that."""
    left, waiting = LARGE_BYTES, [value]
    while waiting:
        item = waiting.pop()
        if isinstance(item, str):
            left -= len(item)
        elif isinstance(item, (Mapping, list, tuple)):
            left -= ITEM_BYTES * len(item)
            if left >= 0:
                waiting.extend(item.values() if isinstance(item, Mapping) else item)
        if left < 0:
            return True
    return False


def catalogue_for(graph: RobotGraph, name: str, type_hash: str) -> Catalogue:
    """Where a type, or a part of an action, is defined as the robot has it.

    Without a hash it is as everybody has it, else as some node of the robot tells it.

    Raises:
        TypeHashError: the robot has other fields under that name, and nobody told which.
        UnknownTypeError: nobody knows it.
    """
    found = graph.catalogue_of(name, type_hash)
    if found is None and not type_hash:
        found = graph.told(name)
    if found is not None:
        return found
    if name in default_catalogue():
        raise TypeHashError(f"the robot's {name} has hash {type_hash[:80]}, ours another: their fields differ")
    raise UnknownTypeError(f"no interface {name!r} in the catalogue, and no node of the robot told it")


def encode(name: str, value: Any, catalogue: Catalogue) -> bytes:
    """A JSON-able message as CDR; FieldError names what does not fit."""
    check_size(name, catalogue)
    if least_bytes(name, catalogue) > LIMITS.frame_bytes:  # a robot may tell what it likes
        raise InvalidRequestError(f"every message of type {name[:80]} is too large to be sent")
    payload = codec(name, catalogue).encode(from_json(message_class(name, catalogue), value))
    if len(payload) > LARGEST:
        raise InvalidRequestError(f"the message has {len(payload)} bytes, at most {LARGEST} may go")
    return payload


def decode(name: str, payload: bytes, catalogue: Catalogue) -> dict[str, Any]:
    """A message as JSON-able values; DecodeError when it is none of that type."""
    return to_json(codec(name, catalogue).decode(payload))
