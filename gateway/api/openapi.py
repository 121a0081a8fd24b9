"""What the permissions mean for a client of the API, written into its OpenAPI document.

Every operation says which permission it needs (`x-metaros-permission`) and how one may prove who one is, and lists the
answers that come from the walls around it and not from the route itself.
"""

from __future__ import annotations

from typing import Any

from fastapi import FastAPI
from fastapi.routing import APIRoute

from gateway.api.allow import declared
from gateway.api.authenticate import COOKIE
from gateway.api.problem import PROBLEM_TYPE
from gateway.identity.permissions import Permission

__all__ = ["describe_permissions"]

SCHEMES: dict[str, Any] = {
    "key": {"type": "http", "scheme": "bearer", "description": "an API key, mrk_…"},
    "session": {"type": "apiKey", "in": "cookie", "name": COOKIE, "description": "with X-CSRF-Token to change things"},
}
PROBLEM: dict[str, Any] = {"content": {PROBLEM_TYPE: {"schema": {"$ref": "#/components/schemas/Problem"}}}}
WALLS = {"400": "The request does not fit", "429": "Too often, or too many"}
PEOPLE = {"401": "Sign in, or the credential is not good", "403": "Not allowed: host, origin, token or role"}
BODIES = {"413": "The body is over its limit", "415": "Send application/json or application/cdr"}


def describe_permissions(app: FastAPI) -> None:
    """Make the application's document say them; call it once all routes are there."""
    plain = app.openapi

    def document() -> dict[str, Any]:
        if app.openapi_schema is None:
            described = plain()
            described.setdefault("components", {})["securitySchemes"] = SCHEMES
            for route in app.routes:
                if isinstance(route, APIRoute) and route.include_in_schema:
                    for method in route.methods or ():
                        _describe(described["paths"][route.path_format][method.lower()], method, declared(route))
            app.openapi_schema = described
        return app.openapi_schema

    app.openapi = document  # type: ignore[method-assign]


def _describe(operation: dict[str, Any], method: str, rows: list[Permission]) -> None:
    answers = {**WALLS, "403": PEOPLE["403"]}
    for row in rows:
        operation["x-metaros-permission"] = row.name
        if row.who == "people":
            operation["security"] = [{name: []} for name in SCHEMES]
            answers |= PEOPLE
    if method not in ("GET", "HEAD"):
        answers |= BODIES
    for status, text in answers.items():
        operation["responses"].setdefault(status, {"description": text, **PROBLEM})
