"""The structure of a type as JSON, for forms and programs that build its messages."""

from __future__ import annotations

import math
from typing import Any

from metaros.idl import ActionDefinition, Catalogue, MessageDefinition, ServiceDefinition, definition_text, type_hash
from metaros.idl.definitions import Field

__all__ = ["shape_of"]


def shape_of(name: str, catalogue: Catalogue) -> dict[str, Any]:
    """The type's parts, the definition of every message that they are made of, and its text; UnknownTypeError.

    `parts` names what is encoded: `message`; `request` and `response`; or `goal`, `result` and `feedback`.
    """
    found = catalogue.get(name)
    parts = _parts(found)
    inner = {one for part in parts.values() for one in catalogue.dependencies(part)}
    return {
        "type": name,
        "type_hash": type_hash(name, catalogue),
        "text": definition_text(found),
        "parts": parts,
        "definitions": {one: _definition(catalogue.message(one)) for one in [*parts.values(), *sorted(inner)]},
    }


def _parts(found: MessageDefinition | ServiceDefinition | ActionDefinition) -> dict[str, str]:
    if isinstance(found, MessageDefinition):
        return {"message": found.name}
    if isinstance(found, ServiceDefinition):
        return {"request": found.request.name, "response": found.response.name}
    return {"goal": found.goal.name, "result": found.result.name, "feedback": found.feedback.name}


def _definition(definition: MessageDefinition) -> dict[str, Any]:
    return {
        "fields": [_field(item) for item in definition.fields],
        "constants": [
            {"name": item.name, "type": item.type.base, "value": _value(item.value)} for item in definition.constants
        ],
    }


def _field(field: Field) -> dict[str, Any]:
    kind = field.type
    return {
        "name": field.name,
        "type": kind.base,
        "array": kind.array,
        "capacity": kind.capacity,
        "string_bound": kind.string_bound,
        "default": _value(field.default),
    }


def _value(value: Any) -> Any:
    """As JSON has it: what is not finite is null there, which an encoder takes as NaN."""
    if isinstance(value, (list, tuple)):
        return [_value(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
