"""Drivers: one folder a kind, each a lifecycle node around a device; run by `metaros driver run` or a table."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from metaros.drivers.manifest import Manifest
from metaros.drivers.registry import all_manifests, driver_kinds, manifest_of

if TYPE_CHECKING:
    from metaros.drivers.node import DriverNode
    from metaros.drivers.run import run_driver
    from metaros.drivers.unit import Device, Unit

__all__ = ["Device", "DriverNode", "Manifest", "Unit", "all_manifests", "driver_kinds", "manifest_of", "run_driver"]

_LATER = {"DriverNode": "node", "run_driver": "run", "Device": "unit", "Unit": "unit"}


def __getattr__(name: str) -> Any:
    if name not in _LATER:  # the table of kinds is read without a node
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"metaros.drivers.{_LATER[name]}"), name)
