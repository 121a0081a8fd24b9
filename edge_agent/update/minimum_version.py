"""The floor: by name, the least version that may ever be installed again. It only rises.

A signed bundle says which floor it brings (`min_version`); it counts once that bundle runs well. So nobody who comes to
hold old signed files, and no gateway, can put a version with a known hole back on a robot.
"""

from __future__ import annotations

from pathlib import Path

from edge_agent.update.errors import UpdateFloorError
from edge_agent.update.files import read_table, replace_table
from metaros.bundle import BundleError, version_key

__all__ = ["Floor"]

NAMES = 1024


class Floor:
    """The file `update/floor.json`. Methods block; SlotError where the disk refuses."""

    def __init__(self, folder: Path) -> None:
        self._path = folder / "floor.json"

    def of(self, name: str) -> str:
        """The floor of a name; "" = none."""
        found = read_table(self._path).get(name, "")
        try:
            version_key(found)
        except BundleError:
            return ""
        return str(found)

    def check(self, name: str, version: str) -> None:
        """That it may be installed. Raises UpdateFloorError."""
        floor = self.of(name)
        if floor and version_key(version) < version_key(floor):
            raise UpdateFloorError(f"{name} {version} is below the floor of this robot, {floor}")

    def rise(self, name: str, version: str) -> None:
        """At least that from now on; "" changes nothing, and so does what is lower."""
        floor = self.of(name)
        if not version or (floor and version_key(version) <= version_key(floor)):
            return
        table = read_table(self._path)
        if name in table or len(table) < NAMES:
            replace_table(self._path, {**table, name: version})
