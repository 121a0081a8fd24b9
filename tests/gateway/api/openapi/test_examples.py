"""The examples of the API's document: every operation has them, and each fits its schema."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import jsonschema_rs
import pytest
from fastapi import FastAPI

from gateway.api import ROUTERS
from gateway.api.openapi.example_words import OPERATIONS
from gateway.api.openapi.examples import example_of
from gateway.api.openapi.permissions import describe_permissions

JSON = "application/json"


@pytest.fixture(scope="module")
def document() -> dict[str, Any]:
    """The API's document, without a gateway behind it."""
    app = FastAPI(
        title="Meta-ROS gateway", version="1", routes=[route for router in ROUTERS for route in router.routes]
    )
    describe_permissions(app, ROUTERS)
    return app.openapi()


def operations(document: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Every operation and its name."""
    for path, methods in document["paths"].items():
        for method, operation in methods.items():
            yield f"{method.upper()} {path}", operation


@dataclass(frozen=True)
class Shown:
    """An example in the document, by the name of what it is one of."""

    name: str
    schema: dict[str, Any]
    example: Any


def faults(document: dict[str, Any], shown: Sequence[Shown]) -> list[str]:
    """What is wrong with examples. They are looked at together, as making one validator takes longer than that."""
    whole = {"components": document["components"], "prefixItems": [item.schema for item in shown]}
    validator = jsonschema_rs.Draft202012Validator(whole)
    return [
        f"{shown[int(error.instance_path[0])].name} {error.instance_path}: {error.message}"
        for error in validator.iter_errors([item.example for item in shown])
    ]


def test_every_body_and_answer_has_an_example_that_fits(document: dict[str, Any]) -> None:
    shown, without = [], []
    for name, operation in operations(document):
        contents = [("request", operation.get("requestBody", {}).get("content", {}))]
        contents += [(status, answer.get("content", {})) for status, answer in operation["responses"].items()]
        for what, content in contents:
            for kind, body in content.items():
                if "json" not in kind or "schema" not in body:
                    continue
                if "example" not in body:
                    without.append(f"{name} {what}")
                else:
                    shown.append(Shown(f"{name} {what}", body["schema"], body["example"]))
    assert without == []
    assert faults(document, shown) == []
    assert len(shown) > 500


def test_every_path_parameter_has_an_example_that_fits(document: dict[str, Any]) -> None:
    shown = [
        Shown(f"{name} {parameter['name']}", parameter["schema"], parameter.get("example"))
        for name, operation in operations(document)
        for parameter in operation.get("parameters", ())
        if parameter["in"] == "path" or "example" in parameter
    ]
    assert faults(document, shown) == []
    assert len(shown) > 100


def test_faults_of_examples_are_found(document: dict[str, Any]) -> None:
    problem = {"$ref": "#/components/schemas/Problem"}
    wrong = [Shown("fits", {"type": "integer"}, 1), Shown("lacks", problem, {}), Shown("other", {"type": "string"}, 2)]
    assert {fault.split()[0] for fault in faults(document, wrong)} == {"lacks", "other"}


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
