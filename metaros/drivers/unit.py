"""The former names of `metaros.drivers.context`: drivers of users' own that were made from an older template."""

from __future__ import annotations

from metaros.drivers.context import Device, DriverContext

__all__ = ["Device", "Unit"]

Unit = DriverContext
