"""Drivers: one folder a kind, each a lifecycle node around a device; run by `metaros driver run` or a table."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from metaros.drivers.manifest import Manifest
from metaros.drivers.registry import all_manifests, driver_kinds, manifest_of

if TYPE_CHECKING:
    from metaros.drivers.context import Device, DriverContext
    from metaros.drivers.node import DriverNode
    from metaros.drivers.run import run_driver

__all__ = [
    "Device",
    "DriverContext",
    "DriverNode",
    "Manifest",
    "all_manifests",
    "driver_kinds",
    "manifest_of",
    "run_driver",
]

_LAZY = {"DriverNode": "node", "run_driver": "run", "Device": "context", "DriverContext": "context", "Unit": "unit"}


def __getattr__(name: str) -> Any:
    if name not in _LAZY:  # the table of kinds is read without a node
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"metaros.drivers.{_LAZY[name]}"), name)
