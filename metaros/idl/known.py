"""Definitions by name and hash: those of the catalogue, of `@message` classes, and those that peers told us.

Two robots may mean different things by one name; the hash tells them apart.
"""

from __future__ import annotations

import threading
from collections import OrderedDict
from typing import Any

from metaros.errors import TypeHashError
from metaros.idl.catalogue import Catalogue, default_catalogue
from metaros.idl.hashing import type_hash
from metaros.limits import LIMITS

__all__ = ["catalogue_of", "remember", "remember_class"]

_lock = threading.Lock()
_known: OrderedDict[tuple[str, str], Catalogue] = OrderedDict()


def catalogue_of(name: str, hash_text: str = "") -> Catalogue | None:
    """The catalogue that has `name` with that hash, or None; without a hash, as in ROS 2 humble, the default one."""
    default = default_catalogue()
    if name in default and (not hash_text.startswith("RIHS01_") or type_hash(name, default) == hash_text):
        return default
    with _lock:
        found = _known.get((name, hash_text))
        if found is not None:
            _known.move_to_end((name, hash_text))
        return found


def remember(name: str, catalogue: Catalogue, *, hash_text: str = "") -> str:
    """Let `catalogue_of` find `name`; its hash. `TypeHashError` if it is not `hash_text`, where that is given.

    At most `LIMITS.type_cache` are kept; the one that was longest not asked for goes first.
    """
    actual = type_hash(name, catalogue)
    if hash_text and actual != hash_text:
        raise TypeHashError(f"the definition of {name} has the hash {actual}, not {hash_text[:80]}")
    with _lock:
        _known[name, actual] = catalogue.definitions
        _known.move_to_end((name, actual))
        if len(_known) > LIMITS.type_cache:
            _known.popitem(last=False)
    return actual


def remember_class(kind: type[Any], *parts: str) -> None:
    """Let `catalogue_of` find what endpoints of a class use, so that peers can ask for it: it, or its `parts`.

    A part is like "_SendGoal". Nothing happens to classes of the default catalogue, or of none.
    """
    catalogue: Catalogue | None = getattr(kind, "__metaros_catalogue__", None)
    if catalogue is None or catalogue.definitions is default_catalogue():
        return
    for part in ("", *parts):
        remember(kind.__metaros_name__ + part, catalogue.definitions)
