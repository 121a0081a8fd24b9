"""Lists: a page of one, of each item the fields that are asked for, and where the next page begins."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Any, TypeVar

from fastapi import Depends, Query
from pydantic import BaseModel

from gateway.api.problem import JsonResponse
from gateway.errors import InvalidRequestError
from metaros.limits import LIMITS

__all__ = [
    "FIELDS",
    "After",
    "Fields",
    "FieldsText",
    "ListLimit",
    "Paged",
    "Window",
    "listing",
    "page_of",
    "read_fields",
]

MAX_FIELDS = 64

ListLimit = Annotated[int, Query(ge=1, le=LIMITS.listed, description="items of one page")]
After = Annotated[str, Query(max_length=600, description="the `next` of the page before")]
FIELDS = "only these fields of each item, with commas: id,link.rtt_ms"
FieldsText = Annotated[str, Query(max_length=2000, description=FIELDS)]
Item = TypeVar("Item")


@dataclass(frozen=True, slots=True)
class Window:
    """What part of a list is asked for."""

    limit: int = LIMITS.listed
    after: str = ""
    fields: str = ""


def _window(limit: ListLimit = LIMITS.listed, after: After = "", fields: FieldsText = "") -> Window:
    return Window(limit, after, fields)


Paged = Annotated[Window, Depends(_window)]


class Fields:
    """Which fields of an item are asked for; none is all."""

    def __init__(self, paths: tuple[tuple[str, ...], ...]) -> None:
        self._paths = paths

    def __bool__(self) -> bool:
        return bool(self._paths)

    def of(self, row: Mapping[str, Any]) -> Mapping[str, Any]:
        """The item with these fields alone; one that it lacks is left out."""
        if not self._paths:
            return row
        kept: dict[str, Any] = {}
        for path in self._paths:
            _copy(row, kept, path)
        return kept


@lru_cache(maxsize=1024)
def read_fields(text: str, model: type[BaseModel]) -> Fields:
    """The fields that a text names; InvalidRequestError for one that the document does not have."""
    paths = tuple(tuple(part.strip().split(".")) for part in text.split(",") if part.strip())
    if len(paths) > MAX_FIELDS:
        raise InvalidRequestError(f"fields: at most {MAX_FIELDS}")
    known = [field.alias or name for name, field in model.model_fields.items()]
    for path in paths:
        if path[0] not in known:
            raise InvalidRequestError(f"fields: there is no {path[0][:64]!r}; there are {', '.join(known)}")
    return Fields(paths)


def page_of(
    items: Iterable[Item], *, limit: int, after: str = "", key: Callable[[Item], str]
) -> tuple[list[Item], str | None]:
    """The items behind the one of the key `after`, and the key behind which the next page begins, or None.

    InvalidRequestError where a list has no item of that key: it is gone, or never was; begin again.
    """
    rest = iter(items)
    if after:
        for item in rest:
            if key(item) == after:
                break
        else:
            raise InvalidRequestError("after: nothing of that name is in the list any more; begin again without it")
    page: list[Item] = []
    for item in rest:
        if len(page) == limit:
            return page, key(page[-1])
        page.append(item)
    return page, None


def listing(
    name: str,
    items: Iterable[Item],
    view: Callable[[Item], Mapping[str, Any]],
    *,
    model: type[BaseModel],
    key: Callable[[Item], str],
    window: Window,
) -> JsonResponse:
    """`{name: [...], "next"}`: a page of some items as the API shows them."""
    chosen = read_fields(window.fields, model)
    page, following = page_of(items, limit=window.limit, after=window.after, key=key)
    return JsonResponse({name: [chosen.of(view(item)) for item in page], "next": following})


def _copy(source: Mapping[str, Any], target: dict[str, Any], path: tuple[str, ...]) -> None:
    first, *rest = path
    if first not in source:
        return
    value = source[first]
    if rest and isinstance(value, Mapping):
        below = target.setdefault(first, {})
        if isinstance(below, dict) and below is not value:
            _copy(value, below, tuple(rest))
    elif not rest:
        target[first] = value
