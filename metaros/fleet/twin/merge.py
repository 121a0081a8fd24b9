"""JSON merge patch, RFC 7396: an object changes the keys that it names, null takes a key away, all else replaces."""

from __future__ import annotations

import copy
from collections.abc import Iterable
from typing import Any

__all__ = ["merge", "merge_all", "patch_between", "same"]


def merge(base: Any, patch: Any) -> Any:
    """`base` with `patch` on top, as a new value that shares nothing with either.

    Documents are at most `MAX_DEPTH` levels deep (`metaros.fleet.twin.canonical_json`), so this calls itself no deeper.
    """
    if not isinstance(patch, dict):
        return copy.deepcopy(patch)
    found = dict(base) if isinstance(base, dict) else {}
    for key, value in patch.items():
        if value is None:
            found.pop(key, None)
        else:
            found[key] = merge(found.get(key), value)
    return {key: value if key in patch else copy.deepcopy(value) for key, value in found.items()}


def merge_all(patches: Iterable[Any]) -> dict[str, Any]:
    """Patches on top of an empty document, the last one on top of all; no null is left."""
    found: dict[str, Any] = {}
    for patch in patches:
        found = merge(found, patch)
    return found


def patch_between(old: Any, new: Any) -> Any:
    """The patch that makes `old` into `new`: `merge(old, patch_between(old, new)) == new` where `new` holds no null."""
    if not isinstance(old, dict) or not isinstance(new, dict):
        return copy.deepcopy(new)
    patch: dict[str, Any] = {key: None for key in old if key not in new}
    for key, value in new.items():
        if key not in old:
            patch[key] = copy.deepcopy(value)
        elif not same(old[key], value):
            patch[key] = patch_between(old[key], value)
    return patch


def same(one: Any, other: Any) -> bool:
    """Whether two JSON values have the same canonical bytes: 1, 1.0 and true are three values, 0.0 and -0.0 two."""
    if isinstance(one, dict) and isinstance(other, dict):
        return one.keys() == other.keys() and all(same(value, other[key]) for key, value in one.items())
    if isinstance(one, list) and isinstance(other, list):
        return len(one) == len(other) and all(same(*pair) for pair in zip(one, other, strict=True))
    return type(one) is type(other) and repr(one) == repr(other)
