"""Introspection of a node: type descriptions and logger levels, by ROS 2's standard services."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from metaros.node.introspection.logger_levels import offer_logger_levels
from metaros.node.introspection.type_description import offer_type_description

if TYPE_CHECKING:
    from metaros.node.introspection.fetch import (
        FoundInterface,
        fetch_interface,
        fetch_interface_async,
        fetch_type,
        fetch_type_async,
        find_interface,
        hash_in_use,
        users_of,
    )

__all__ = [
    "FoundInterface",
    "fetch_interface",
    "fetch_interface_async",
    "fetch_type",
    "fetch_type_async",
    "find_interface",
    "hash_in_use",
    "offer_logger_levels",
    "offer_type_description",
    "users_of",
]


def __getattr__(name: str) -> Any:
    if name not in __all__:  # only who asks other nodes loads it
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module("metaros.node.introspection.fetch"), name)
