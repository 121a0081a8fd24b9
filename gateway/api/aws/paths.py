"""Which operation a request is: by its method, its path and sometimes its query, from botocore's own table of them."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import NamedTuple
from urllib.parse import parse_qsl, unquote

from gateway.api.aws.prefix import PREFIX
from gateway.automation.functions.catalogue.shapes import model

__all__ = ["CODE_OPERATIONS", "Found", "find_operation"]

CODE_OPERATIONS = frozenset({"CreateFunction", "UpdateFunctionCode", "PublishLayerVersion"})  # whose bodies are large


class Found(NamedTuple):
    """An operation and what stands in its path."""

    operation: str
    members: Mapping[str, str]


class _Template(NamedTuple):
    operation: str
    segments: tuple[str, ...]
    query: tuple[tuple[str, str], ...]  # what has to be there


def find_operation(method: str, raw_path: str, query: str) -> Found | None:
    """The operation of a request; `raw_path` is as it came, percent signs and all. None: there is none."""
    segments = tuple(raw_path.removeprefix(PREFIX).strip("/").split("/"))
    pairs: set[tuple[str, str]] | None = None
    for template in _table().get((method, segments[0], len(segments)), ()):
        members = _match(template.segments, segments)
        if members is None:
            continue
        if template.query:
            pairs = set(parse_qsl(query, keep_blank_values=True)) if pairs is None else pairs
            if not pairs.issuperset(template.query):
                continue
        return Found(template.operation, members)
    return None


def _match(template: tuple[str, ...], segments: tuple[str, ...]) -> dict[str, str] | None:
    members = {}
    for wanted, said in zip(template, segments, strict=True):
        if wanted.startswith("{"):
            members[wanted[1:-1]] = unquote(said)
        elif wanted != said:
            return None
    return members


@lru_cache(maxsize=1)
def _table() -> dict[tuple[str, str, int], tuple[_Template, ...]]:
    """By method, first segment and number of segments; those that want more come first."""
    found: dict[tuple[str, str, int], list[_Template]] = {}
    for name in model().operation_names:
        http = model().operation_model(name).http
        path, _, query = http["requestUri"].partition("?")
        segments = tuple(path.strip("/").split("/"))
        template = _Template(name, segments, tuple(parse_qsl(query)))
        found.setdefault((http["method"], segments[0], len(segments)), []).append(template)
    return {key: tuple(sorted(items, key=_order)) for key, items in found.items()}


def _order(template: _Template) -> tuple[int, tuple[bool, ...]]:
    return -len(template.query), tuple(segment.startswith("{") for segment in template.segments)
