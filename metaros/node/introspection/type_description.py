"""`~/get_type_description`: the fields and the source of every type in the catalogue, for peers that lack it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final

from metaros.errors import UsageError
from metaros.idl import default_catalogue, definition_text, type_description, type_hash
from metaros.idl.definitions import MessageDefinition, Value
from metaros.idl.derived import root_names, whole_message
from metaros.node.standard import StandardService, serve
from metaros.wire import qos_services

if TYPE_CHECKING:
    from metaros.node.node import Node

__all__ = ["SERVICE", "offer_type_description"]

SERVICE: Final = StandardService(
    "get_type_description",
    "type_description_interfaces/srv/GetTypeDescription",
    "RIHS01_69b9c19c1021405984cc60dbbb1edceb147a6538b411d812ba6afabeed962cd5",
)


def offer_type_description(node: Node) -> None:
    """Serve it; any type of the catalogue is described, used by this node or not."""
    serve(node, SERVICE, _describe, qos_services)


def _describe(request: Any, response: Any) -> None:
    name, wanted = request.type_name, request.type_hash
    try:
        known = type_hash(name)
    except UsageError as error:
        response.failure_reason = str(error)
        return
    if wanted and wanted != known:
        response.failure_reason = f"{name} is {known} here, not {wanted[:80]}"
        return
    description = type_description(name)
    response.type_description = _message(description)
    if request.include_type_sources:
        parts = (description["type_description"], *description["referenced_type_descriptions"])
        response.type_sources = [_source(part["type_name"]) for part in parts]
    response.successful = True


def _message(description: Mapping[str, Any]) -> Any:
    from metaros.interfaces.type_description_interfaces.msg import TypeDescription

    return TypeDescription(
        type_description=_individual(description["type_description"]),
        referenced_type_descriptions=[_individual(part) for part in description["referenced_type_descriptions"]],
    )


def _individual(part: Mapping[str, Any]) -> Any:
    from metaros.interfaces.type_description_interfaces.msg import Field, FieldType, IndividualTypeDescription

    definition = default_catalogue().get(part["type_name"])
    if not isinstance(definition, MessageDefinition):
        definition = whole_message(definition)
    defaults = {field.name: field.default for field in definition.fields}
    fields = [
        Field(name=item["name"], type=FieldType(**item["type"]), default_value=_literal(defaults.get(item["name"])))
        for item in part["fields"]
    ]
    return IndividualTypeDescription(type_name=part["type_name"], fields=fields)


def _literal(default: Value | None) -> str:
    """A default as rosidl's generator writes it: Python literals, arrays as tuples of at least two places."""
    if default is None:
        return ""
    if not isinstance(default, list):
        return str(default)
    items = [repr(item) for item in default]
    return f"({', '.join(items + [''] * (2 - len(items)))})"


def _source(name: str) -> Any:
    """The text that defines the type; the parts of services and actions have none of their own."""
    from metaros.interfaces.type_description_interfaces.msg import TypeSource

    if any(root in default_catalogue() for root in root_names(name)):
        return TypeSource(type_name=name, encoding="implicit")
    text = definition_text(default_catalogue().get(name))
    return TypeSource(type_name=name, encoding=name.split("/")[1], raw_file_contents=text)
