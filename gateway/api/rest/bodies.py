"""Bodies of requests that change something: read and checked by a model, and described in OpenAPI."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError
from starlette.datastructures import QueryParams
from starlette.requests import Request

from gateway.api.problem import PROBLEM_TYPE
from gateway.errors import InvalidRequestError

__all__ = [
    "PROBLEMS",
    "PROBLEM_REF",
    "body_document",
    "query_document",
    "read_body",
    "read_query",
    "spelled_out",
]

Body = TypeVar("Body", bound=BaseModel)
PROBLEM_REF = {"$ref": "#/components/schemas/Problem"}
# By reference: as models they would be a thousand that FastAPI makes at each start.
PROBLEMS: dict[int | str, dict[str, Any]] = {
    status: {"content": {PROBLEM_TYPE: {"schema": PROBLEM_REF}}} for status in (400, 404, 409, 413, 415, 502, 503, 504)
}
_BODY = "x-body"


def body_document(model: type[BaseModel], *, cdr: bool = False) -> dict[str, Any]:
    """For OpenAPI: a body that the handler reads by itself. Its schema is made by `spelled_out`, if ever."""
    return {_BODY: (model, cdr)}


def spelled_out(extra: dict[str, Any]) -> dict[str, Any]:
    """The OpenAPI text of an operation, with the schema of its body."""
    if _BODY not in extra:
        return extra
    model, cdr = extra[_BODY]
    whole = model.model_json_schema()
    content: dict[str, Any] = {"application/json": {"schema": _inlined(whole, whole.pop("$defs", {}))}}
    if cdr:
        content["application/cdr"] = {"schema": {"type": "string", "format": "binary"}}
    return {"requestBody": {"required": True, "content": content}}


def _inlined(part: Any, parts: dict[str, Any]) -> Any:
    """A schema with what its references mean in their place: they would be looked for in the whole document."""
    if isinstance(part, list):
        return [_inlined(item, parts) for item in part]
    if not isinstance(part, dict):
        return part
    if "$ref" in part:
        return _inlined(parts[part["$ref"].rpartition("/")[2]], parts)
    return {name: _inlined(item, parts) for name, item in part.items()}


def query_document(model: type[BaseModel]) -> dict[str, Any]:
    """The OpenAPI text of a query that the handler reads by itself."""
    document = model.model_json_schema()
    return {
        "parameters": [
            {"name": name, "in": "query", "required": False, "schema": schema, "description": schema["description"]}
            for name, schema in document["properties"].items()
        ]
    }


def read_query(request: Request, model: type[Body]) -> Body:
    """The request's query as the model, for reading alone: others may have the same.

    InvalidRequestError names what does not fit. What the model does not know is left.
    """
    try:
        found: Body = _query(model, request.scope["query_string"])
    except ValidationError as error:
        raise InvalidRequestError(_faults(error)) from error
    return found


@lru_cache(maxsize=1024)
def _query(model: type[Any], text: bytes) -> Any:
    """Remembered, as many ask the same; what is wrong is not."""
    return model.model_validate(dict(QueryParams(text)))


async def read_body(request: Request, model: type[Body]) -> Body:
    """The request's JSON as the model; InvalidRequestError names what does not fit."""
    if "json" not in request.headers["content-type"]:
        raise InvalidRequestError("this request has a JSON body")
    try:
        read = model.model_validate_json(await request.body(), strict=True)  # 0 is no false, and "5" no number
    except ValidationError as error:
        raise InvalidRequestError(_faults(error)) from error
    for name, value in read:
        texts = value if isinstance(value, list) else [value]  # messages for robots are objects, and free
        if any(isinstance(text, str) and "\0" in text for text in texts):
            raise InvalidRequestError(f"{name}: text has no NUL")  # no database takes one
    return read


def _faults(error: ValidationError) -> str:
    return "; ".join(f"{'.'.join(str(part) for part in item['loc'])}: {item['msg']}" for item in error.errors())[:1000]
