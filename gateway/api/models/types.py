"""Types in the API's documents: what a message, a service or an action is made of."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from gateway.api.models.base import Exact

__all__ = ["TypeShape"]

Plain = bool | int | float | str


class TypeField(Exact):
    """One field; `capacity` is the n of `T[n]` and `T[<=n]`, `string_bound` that of `string<=n`, else 0."""

    name: str
    type: str = Field(description="a primitive, or the full name of a message")
    array: Literal["", "fixed", "bounded", "unbounded"]
    capacity: int
    string_bound: int
    default: Plain | list[Plain | None] | None = Field(description="null: zero, empty text, an empty list")


class TypeConstant(Exact):
    """A named value; it is not on the wire."""

    name: str
    type: str
    value: Plain | None


class TypeDefinition(Exact):
    """A message's fields, in their order, and its constants."""

    fields: list[TypeField]
    constants: list[TypeConstant]


class TypeShape(Exact):
    """A type: what is encoded of it (`parts`), and every message that those are made of."""

    type: str
    type_hash: str
    text: str = Field(description="as in its .msg, .srv or .action file, without comments")
    parts: dict[Literal["message", "request", "response", "goal", "result", "feedback"], str]
    definitions: dict[str, TypeDefinition]
