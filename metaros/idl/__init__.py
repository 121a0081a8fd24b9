"""ROS 2 interface definitions: parser, catalogue, type hashes, schema texts and message classes."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from metaros.idl import globs, names
from metaros.idl.catalogue import Catalogue, default_catalogue, parse_definition, release_catalogue
from metaros.idl.classes import Action, Message, Service, message_class
from metaros.idl.definitions import (
    ActionDefinition,
    Constant,
    Definition,
    Field,
    FieldType,
    MessageDefinition,
    ServiceDefinition,
)
from metaros.idl.hashing import parse_hash, type_description, type_hash
from metaros.idl.known import catalogue_of, remember, remember_class
from metaros.idl.parser import parse_action, parse_msg, parse_srv
from metaros.idl.schema import add_schema_text, definition_text, schema_text

if TYPE_CHECKING:
    from metaros.idl import marks
    from metaros.idl.annotated import message
    from metaros.idl.annotated_service import action, service

__all__ = [
    "Action",
    "ActionDefinition",
    "Catalogue",
    "Constant",
    "Definition",
    "Field",
    "FieldType",
    "Message",
    "MessageDefinition",
    "Service",
    "ServiceDefinition",
    "action",
    "add_schema_text",
    "catalogue_of",
    "default_catalogue",
    "definition_text",
    "globs",
    "marks",
    "message",
    "message_class",
    "names",
    "parse_action",
    "parse_definition",
    "parse_hash",
    "parse_msg",
    "parse_srv",
    "release_catalogue",
    "remember",
    "remember_class",
    "schema_text",
    "service",
    "type_description",
    "type_hash",
]


def __getattr__(name: str) -> Any:
    """What only programs with types of their own need: others start without it."""
    if name == "message":
        return importlib.import_module("metaros.idl.annotated").message
    if name in ("action", "service"):
        return getattr(importlib.import_module("metaros.idl.annotated_service"), name)
    if name == "marks":
        return importlib.import_module("metaros.idl.marks")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
