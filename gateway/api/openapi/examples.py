"""Examples in the API's document: a request body, an answer and each parameter of every operation.

They are made of the schemas, with the words of a table for what a field is called, so that a new route has them, and
so that they cannot be at odds with it. What a schema leaves open has its example written out by operation.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from gateway.api.openapi.example_words import NUMBERS, OPERATIONS, TEXTS
from gateway.api.problem import PROBLEM_TYPE
from gateway.errors import ERRORS

__all__ = ["add_examples", "example_of"]

JSON = "application/json"
DEEPEST = 12


def add_examples(document: dict[str, Any]) -> None:
    """Write them into an OpenAPI document, where there are none yet."""
    parts = document.get("components", {}).get("schemas", {})
    for path, operations in document["paths"].items():
        for method, operation in operations.items():
            _describe(operation, OPERATIONS.get(f"{method.upper()} {path}", {}), parts)


def _describe(operation: dict[str, Any], written: Mapping[str, Any], parts: Mapping[str, Any]) -> None:
    for parameter in operation.get("parameters", ()):
        value = example_of(parameter["schema"], parts, parameter["name"])
        if parameter["in"] == "path" or (value not in ("", None, []) and parameter.get("required")):
            parameter.setdefault("example", value)
    body = operation.get("requestBody", {}).get("content", {}).get(JSON)
    if body is not None:
        body.setdefault("example", written.get("request", example_of(body["schema"], parts)))
    for status, answer in operation["responses"].items():
        for kind, content in answer.get("content", {}).items():
            if kind == PROBLEM_TYPE:
                content.setdefault("example", _problem(status))
            elif kind == JSON and "schema" in content:
                content.setdefault("example", written.get("answer", example_of(content["schema"], parts)))


def _problem(status: str) -> dict[str, Any]:
    row = next((row for row in ERRORS if str(row.http) == status), ERRORS[0])
    urn = f"urn:metaros:error:{row.code}"
    found = {"type": urn, "title": row.title, "status": row.http, "code": row.code, "detail": row.title.lower()}
    return {**found, "retry_after_s": 0.5} if status == "429" else found


def example_of(schema: Mapping[str, Any], parts: Mapping[str, Any], name: str = "", depth: int = 0) -> Any:
    """A value that fits a JSON schema; `parts` are what its references mean, `name` what its field is called."""
    if "$ref" in schema:
        return example_of(parts[schema["$ref"].rpartition("/")[2]], parts, name, depth + 1)
    if "const" in schema:
        return schema["const"]
    if "enum" in schema:
        return schema["enum"][0]
    for choice in ("anyOf", "oneOf", "allOf"):
        if choice in schema:
            some = [item for item in schema[choice] if item.get("type") != "null"]
            return example_of(some[0], parts, name, depth + 1)
    kind = schema.get("type")
    if kind == "object" or "properties" in schema:
        return _object(schema, parts, name, depth)
    if kind == "array":
        return _array(schema, parts, name, depth)
    if kind == "boolean":
        return bool(schema.get("default", True))
    if kind in ("integer", "number"):
        return _number(schema, name)
    if kind == "string":
        return _text(schema, name)
    return {}


def _object(schema: Mapping[str, Any], parts: Mapping[str, Any], name: str, depth: int) -> dict[str, Any]:
    required = schema.get("required", ())
    made = {
        field: example_of(below, parts, _named(schema, field), depth + 1)
        for field, below in schema.get("properties", {}).items()
        if depth < DEEPEST or field in required
    }
    more = schema.get("additionalProperties")
    if not made and isinstance(more, dict) and more:
        names = schema.get("propertyNames", {}).get("enum", [TEXTS.get(f"{name}*", "name")])
        made[names[0]] = example_of(more, parts, name, depth + 1)
    return made


def _named(schema: Mapping[str, Any], field: str) -> str:
    """What the table calls the field of a document: `Robot.id`, where that is not just any id."""
    own = f"{schema.get('title', '')}.{field}"
    return own if own in TEXTS else field


def _array(schema: Mapping[str, Any], parts: Mapping[str, Any], name: str, depth: int) -> list[Any]:
    if "prefixItems" in schema:
        return [example_of(item, parts, name, depth + 1) for item in schema["prefixItems"]]
    if depth >= DEEPEST and not schema.get("minItems"):
        return []
    return [example_of(schema.get("items", {}), parts, name, depth + 1)] * max(1, schema.get("minItems", 1))


def _number(schema: Mapping[str, Any], name: str) -> float | int:
    least = schema.get("minimum", schema.get("exclusiveMinimum", 0))
    most = schema.get("maximum", schema.get("exclusiveMaximum", math.inf))
    value = schema.get("default", NUMBERS.get(name, max(least, 1)))
    if not isinstance(value, (int, float)) or not least <= value <= most or value == schema.get("exclusiveMinimum"):
        value = least + (1 if "exclusiveMinimum" in schema else 0)
    return int(value) if schema["type"] == "integer" else float(value)


def _text(schema: Mapping[str, Any], name: str) -> str:
    text = TEXTS.get(name, str(schema.get("default") or "text"))
    if schema.get("pattern") == "^(json|text)$":
        text = "json"
    short, most = schema.get("minLength", 0), schema.get("maxLength", 1 << 20)
    return text.ljust(short, "x")[:most]
