"""The examples of the API's document: every operation has them, and each fits its schema."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import jsonschema_rs
import pytest
from fastapi import FastAPI

from gateway.api import ROUTERS
from gateway.api.example_words import OPERATIONS
from gateway.api.examples import example_of
from gateway.api.openapi import describe_permissions

JSON = "application/json"


@pytest.fixture(scope="module")
def document() -> dict[str, Any]:
    """The API's document, without a gateway behind it."""
    app = FastAPI(title="x", version="1")
    for router in ROUTERS:
        app.include_router(router)
    describe_permissions(app, ROUTERS)
    return app.openapi()


def operations(document: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Every operation and its name."""
    for path, methods in document["paths"].items():
        for method, operation in methods.items():
            yield f"{method.upper()} {path}", operation


def faults(document: dict[str, Any], schema: dict[str, Any], value: Any) -> list[str]:
    """What is wrong with a value."""
    whole = {"components": document["components"], **schema}
    validator = jsonschema_rs.Draft202012Validator(whole)
    return [f"{error.instance_path}: {error.message}" for error in validator.iter_errors(value)]


def test_every_body_and_answer_has_an_example_that_fits(document: dict[str, Any]) -> None:
    wrong: list[tuple[str, Any]] = []
    count = 0
    for name, operation in operations(document):
        contents = [("request", operation.get("requestBody", {}).get("content", {}))]
        contents += [(status, answer.get("content", {})) for status, answer in operation["responses"].items()]
        for what, content in contents:
            for kind, body in content.items():
                if "json" not in kind or "schema" not in body:
                    continue
                count += 1
                if "example" not in body:
                    wrong.append((f"{name} {what}", "no example"))
                elif found := faults(document, body["schema"], body["example"]):
                    wrong.append((f"{name} {what}", found))
    assert wrong == []
    assert count > 500


def test_every_path_parameter_has_an_example_that_fits(document: dict[str, Any]) -> None:
    wrong = [
        (name, parameter["name"])
        for name, operation in operations(document)
        for parameter in operation.get("parameters", ())
        if (parameter["in"] == "path" or "example" in parameter)
        and faults(document, parameter["schema"], parameter.get("example"))
    ]
    assert wrong == []


def test_what_is_written_out_is_of_an_operation(document: dict[str, Any]) -> None:
    assert set(OPERATIONS) <= {name for name, _ in operations(document)}


@pytest.mark.parametrize(
    ("schema", "value"),
    [
        ({"type": "integer", "exclusiveMinimum": 5}, 6),
        ({"type": "number", "minimum": 2, "maximum": 3}, 2.0),
        ({"type": "string", "minLength": 6}, "textxx"),
        ({"type": "string", "maxLength": 2}, "te"),
        ({"anyOf": [{"type": "null"}, {"type": "boolean"}]}, True),
        ({"type": "array", "items": {"type": "string"}, "minItems": 2}, ["text", "text"]),
        ({"type": "object", "additionalProperties": {"type": "integer"}}, {"name": 1}),
        ({"$ref": "#/components/schemas/A"}, "only"),
        ({"type": "array", "prefixItems": [{"const": 1}, {"type": "string"}]}, [1, "text"]),
    ],
)
def test_an_example_of_a_schema(schema: dict[str, Any], value: Any) -> None:
    assert example_of(schema, {"A": {"enum": ["only"]}}) == value
