"""`~/get_type_description`: the fields and the source of every type in the catalogue, for peers that lack it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from metaros.idl import Catalogue, catalogue_of, default_catalogue, definition_text, type_description, type_hash
from metaros.idl.definitions import MessageDefinition, Value
from metaros.idl.derived import root_names, whole_message
from metaros.node.core import NodeCore
from metaros.node.service import Service
from metaros.node.standard_services import StandardService, serve
from metaros.wire import qos_services

__all__ = ["SERVICE", "describe", "offer_type_description"]

SERVICE: Final = StandardService(
    "get_type_description",
    "type_description_interfaces/srv/GetTypeDescription",
    "RIHS01_69b9c19c1021405984cc60dbbb1edceb147a6538b411d812ba6afabeed962cd5",
)


def offer_type_description(node: NodeCore) -> Service:
    """Serve it; any type of the catalogue and every `@message` class is described, used by this node or not."""
    return serve(node, SERVICE, _describe, qos_services)


def _describe(request: Any, response: Any) -> None:
    name, wanted = request.type_name, request.type_hash
    catalogue = catalogue_of(name, wanted) or default_catalogue()
    if name not in catalogue:
        response.failure_reason = f"no interface {name!r} in the catalogue"
        return
    known = type_hash(name, catalogue)
    if wanted and wanted != known:
        response.failure_reason = f"{name} is {known} here, not {wanted[:80]}"
        return
    describe(name, catalogue, response, sources=request.include_type_sources)


def describe(name: str, catalogue: Catalogue, response: Any, *, sources: bool = True) -> None:
    """Fill in a response with what `catalogue` has of a type."""
    description = type_description(name, catalogue)
    response.type_description = _message(description, catalogue)
    if sources:
        parts = (description["type_description"], *description["referenced_type_descriptions"])
        response.type_sources = [_source(part["type_name"], catalogue) for part in parts]
    response.successful = True


def _message(description: Mapping[str, Any], catalogue: Catalogue) -> Any:
    from metaros.interfaces.type_description_interfaces.msg import TypeDescription

    parts = description["referenced_type_descriptions"]
    return TypeDescription(
        type_description=_individual(description["type_description"], catalogue),
        referenced_type_descriptions=[_individual(part, catalogue) for part in parts],
    )


def _individual(part: Mapping[str, Any], catalogue: Catalogue) -> Any:
    from metaros.interfaces.type_description_interfaces.msg import Field, FieldType, IndividualTypeDescription

    definition = catalogue.get(part["type_name"])
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


def _source(name: str, catalogue: Catalogue) -> Any:
    """The text that defines the type; the parts of services and actions have none of their own."""
    from metaros.interfaces.type_description_interfaces.msg import TypeSource

    if any(root in catalogue for root in root_names(name)):
        return TypeSource(type_name=name, encoding="implicit")
    text = definition_text(catalogue.get(name))
    return TypeSource(type_name=name, encoding=name.split("/")[1], raw_file_contents=text)
