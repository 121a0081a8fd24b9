"""Drivers: one folder a kind, each a node that publishes what a device sees; started by `metaros driver run`."""

from __future__ import annotations

from metaros.drivers.registry import DRIVERS, Driver, driver_kinds, run_driver

__all__ = ["DRIVERS", "Driver", "driver_kinds", "run_driver"]
