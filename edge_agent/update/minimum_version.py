"""Rollback protection: by name, the minimum version that may still be installed. It only rises.

A signed bundle says which minimum it sets (`min_version`); it counts once that bundle runs well. So nobody who comes to
hold old signed files, and no gateway, can put a version with a known hole back on a robot.
"""

from __future__ import annotations

from pathlib import Path

from edge_agent.update.errors import UpdateFloorError
from edge_agent.update.files import read_table, replace_table
from metaros.fleet.bundle import BundleError, version_key

__all__ = ["MinimumVersions"]

NAMES = 1024


class MinimumVersions:
    """The file `update/floor.json`. Methods block; SlotError where the disk refuses."""

    def __init__(self, folder: Path) -> None:
        self._path = folder / "floor.json"

    def of(self, name: str) -> str:
        """The minimum version of a name; "" = none."""
        found = read_table(self._path).get(name, "")
        try:
            version_key(found)
        except BundleError:
            return ""
        return str(found)

    def check(self, name: str, version: str) -> None:
        """That it may be installed. Raises UpdateFloorError."""
        minimum = self.of(name)
        if minimum and version_key(version) < version_key(minimum):
            raise UpdateFloorError(f"{name} {version} is below the minimum version of this robot, {minimum}")

    def raise_to(self, name: str, version: str) -> None:
        """At least that from now on; "" changes nothing, and so does what is lower."""
        minimum = self.of(name)
        if not version or (minimum and version_key(version) <= version_key(minimum)):
            return
        table = read_table(self._path)
        if name in table or len(table) < NAMES:
            replace_table(self._path, {**table, name: version})
