"""Types of a remote robot: ours where the robot has that very one, else as its gateway tells what is in it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from metaros.cli.remote.robot import RemoteRobot
from metaros.errors import MetarosError, RefusedError, TypeHashError, UnknownTypeError

if TYPE_CHECKING:
    from metaros.idl import Catalogue, Definition

__all__ = ["catalogue_of_shape", "find_remote_interface"]


def find_remote_interface(robot: RemoteRobot, type_name: str, type_hash: str = "") -> tuple[Catalogue, bool]:
    """The catalogue with a type as the robot has it, and whether the gateway told it, where we did not know it.

    `type_hash` is that of a message or a service; without one the gateway's word is taken. UnknownTypeError.
    """
    from metaros.idl import catalogue_of, default_catalogue

    known = catalogue_of(type_name, type_hash) if type_hash.startswith("RIHS01_") else None
    if known is not None:
        return known, False
    try:
        shape = robot.http.get(robot.path("types", *type_name.split("/")))
    except RefusedError as error:
        if error.reason != "unknown_type":
            raise
        raise UnknownTypeError(
            f"nobody tells the definition of {type_name}: it is in no catalogue, and no node of the robot told it"
        ) from error
    catalogue = catalogue_of_shape(shape)
    if type_hash.startswith("RIHS01_") and shape["type_hash"] != type_hash:
        raise TypeHashError(f"the robot's {type_name} is {type_hash}, the gateway knows {shape['type_hash']}")
    return catalogue, catalogue.home(type_name) is not default_catalogue()


def catalogue_of_shape(shape: Mapping[str, Any]) -> Catalogue:
    """The type that a gateway shows, with its parts; TypeHashError where it has not the hash that it is shown with."""
    from metaros.cdr.layout import check_size
    from metaros.idl import (
        Catalogue,
        MessageDefinition,
        default_catalogue,
        definition_text,
        parse_definition,
        type_hash,
    )

    name, told = str(shape["type"]), shape["definitions"]
    catalogue = Catalogue(base=default_catalogue())
    definitions: list[Definition] = [parse_definition(str(shape["text"]), name)]  # the parser is who checks names
    inner = set(told) - set(shape["parts"].values())
    for part in sorted(inner):
        made = MessageDefinition(part, *_members(told[part]))
        definitions.append(parse_definition(definition_text(made), part))
    shipped = default_catalogue()
    catalogue.add_all([one for one in definitions if one.name not in shipped or shipped.get(one.name) != one])
    try:
        actual = type_hash(name, catalogue)
    except MetarosError as error:
        raise UnknownTypeError(f"the gateway does not tell all of {name}: {error}") from error
    if actual != shape["type_hash"]:
        raise TypeHashError(f"what the gateway tells of {name} has the hash {actual}, not {shape['type_hash']}")
    check_size(name, catalogue)
    return catalogue


def _members(told: Mapping[str, Any]) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
    """Fields and constants."""
    from metaros.idl import Constant, Field, FieldType

    fields = tuple(
        Field(
            item["name"],
            FieldType(item["type"], item["array"], item["capacity"], item["string_bound"]),
            item["default"],
        )
        for item in told["fields"]
    )
    constants = tuple(
        Constant(item["name"], FieldType(item["type"]), item["value"])
        for item in told["constants"]
        if item["value"] is not None  # what is not finite is no JSON
    )
    return fields, constants
