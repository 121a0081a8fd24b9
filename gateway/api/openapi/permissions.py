"""Writes what routes require of a client (permissions, rates, errors) into the OpenAPI document.

Every operation says which permission it needs (`x-metaros-permission`) and how one may prove who one is, and lists the
answers that come from the walls around it and not from the route itself. Errors are problem documents everywhere.
Examples are added last: of each request, answer and parameter.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

from fastapi import APIRouter, FastAPI
from fastapi.routing import APIRoute

from gateway.api.authorization import SAFE_METHODS, permissions_of
from gateway.api.middleware.authenticate import COOKIE
from gateway.api.openapi.examples import add_examples
from gateway.api.problem import PROBLEM_TYPE
from gateway.api.rest.bodies import PROBLEM_REF, spelled_out
from gateway.identity.permissions import Permission

__all__ = ["describe_permissions"]

SCHEMES: dict[str, Any] = {
    "key": {"type": "http", "scheme": "bearer", "description": "an API key, mrk_…"},
    "session": {"type": "apiKey", "in": "cookie", "name": COOKIE, "description": "with X-CSRF-Token to change things"},
}
WALLS = {
    "400": "The request does not fit",
    "403": "Not allowed: host, origin, token or role",
    "408": "The request did not come in time",
    "429": "Too often, or too many",
    "503": "Not now: the store or the robot is away, or too much is under way",
}
PEOPLE = {"401": "Sign in, or the credential is not good"}
BODIES = {"413": "The body is over its limit", "415": "Send application/json or application/cdr"}
NAMED = {"404": "There is nothing of that name, or it is out of scope"}
HEADERS: dict[str, dict[str, Any]] = {
    "401": {"WWW-Authenticate": {"required": True, "schema": {"type": "string", "const": "Bearer"}}},
    "429": {"Retry-After": {"schema": {"type": "integer", "minimum": 1}}},  # not where a table is full: too_many
}
NEVER = ("HTTPValidationError", "ValidationError")  # FastAPI's; ours are problem documents with status 400
_MADE: dict[tuple[object, ...], dict[str, Any]] = {}  # takes a second, and the gateways of a process share it


def describe_permissions(app: FastAPI, routers: Iterable[APIRouter]) -> None:
    """Make the application's document say them, for all routes of these routers."""
    plain, served = app.openapi, tuple(routers)
    key = (app.title, *map(id, served))

    def document() -> dict[str, Any]:
        if app.openapi_schema is None:
            app.openapi_schema = _MADE.get(key)
        if app.openapi_schema is None:
            for route in _described(served):
                route.openapi_extra = spelled_out(route.openapi_extra or {})
            described = plain()
            components = described.setdefault("components", {})
            components["securitySchemes"] = SCHEMES
            for name in NEVER:
                components.get("schemas", {}).pop(name, None)
            for route in _described(served):
                for method in route.methods or ():
                    operation = described["paths"][route.path_format][method.lower()]
                    _describe(operation, route.path_format, method, permissions_of(route))
            add_examples(described)
            app.openapi_schema = _MADE[key] = described
        return app.openapi_schema

    app.openapi = document  # type: ignore[method-assign]


def _described(routers: Iterable[APIRouter]) -> Iterator[APIRoute]:
    for router in routers:
        for route in router.routes:
            if isinstance(route, APIRoute) and route.include_in_schema:
                yield route


def _describe(operation: dict[str, Any], path: str, method: str, rows: list[Permission]) -> None:
    answers = dict(WALLS)
    for row in rows:
        operation["x-metaros-permission"] = row.name
        if row.who in ("people", "enrolled"):
            operation["security"] = [{name: []} for name in SCHEMES]
            answers |= PEOPLE
    if method not in SAFE_METHODS:
        answers |= BODIES
    if "{" in path:
        answers |= NAMED
    responses: dict[str, Any] = operation["responses"]
    responses.pop("422", None)
    for status, text in answers.items():
        responses.setdefault(status, {"description": text, "content": {PROBLEM_TYPE: {"schema": PROBLEM_REF}}})
    for status, answer in responses.items():
        _as_problem(answer)
        if status in HEADERS:
            answer["headers"] = HEADERS[status]


def _as_problem(answer: dict[str, Any]) -> None:
    """A route declares the model alone; the type that it is sent with is the same for all."""
    content = answer.get("content", {})
    if content.get("application/json", {}).get("schema") == PROBLEM_REF:
        answer["content"] = {PROBLEM_TYPE: {"schema": PROBLEM_REF}}
