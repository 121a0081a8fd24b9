"""A/B slots for versions of the agent, beside the base install, which is never touched.

`slots/current` is one small file that says all that a start needs: which slot runs, whether it is being tried, how
often it was started since, and where to go back to. It is replaced by one rename, so that at each moment it is the old
or the new one. A slot counts once `complete.json` is in it, which is written last, with everything before it synced,
and taken away first. What cannot be read is the base install: it always starts.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import sys
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any, Literal

from edge_agent.update.errors import SlotError
from edge_agent.update.files import read_table, remove_file, replace_table, sync_all

__all__ = ["BASE", "COMPLETE", "Current", "Slots", "python_of"]

BASE = "base"
SLOTS = ("a", "b")
COMPLETE = "complete.json"
_FORMAT = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Current:
    """What runs. `version` is "" for the base install, whose version it knows itself."""

    slot: str = BASE
    version: str = ""
    state: Literal["good", "probing"] = "good"
    boots: int = 0  # starts since it is being tried
    previous: str = BASE  # where to go back to
    previous_version: str = ""
    failed_version: str = ""  # what was taken back last
    failed_reason: str = ""

    @property
    def probing(self) -> bool:
        """Whether it has yet to prove itself."""
        return self.state == "probing"


class Slots:
    """The folder `slots` of an agent's state directory. Methods block, and raise SlotError where the disk refuses."""

    def __init__(self, state_dir: Path, *, calls: Any = os) -> None:
        self.folder = state_dir / "slots"
        self._calls = calls

    def read(self) -> Current:
        """What runs; the base install where nothing can be read, or what is read is nothing that we write."""
        table = read_table(self.folder / "current")
        if table.pop("format", None) != _FORMAT:
            return Current()
        kinds = {item.name: int if item.name == "boots" else str for item in fields(Current)}
        if table.keys() != kinds.keys() or any(type(table[name]) is not kind for name, kind in kinds.items()):
            return Current()
        if table["slot"] not in (BASE, *SLOTS) or table["previous"] not in (BASE, *SLOTS):
            return Current()
        return Current(**table) if table["state"] in ("good", "probing") else Current()

    def path(self, slot: str) -> Path:
        """The folder of a slot."""
        return self.folder / slot

    def complete(self, slot: str, version: str) -> bool:
        """Whether all of that version is in the slot."""
        if slot == BASE:
            return True
        table = read_table(self.path(slot) / COMPLETE)
        return bool(version) and table.get("version") == version and python_of(self.path(slot)).exists()

    def minimum_of(self, slot: str) -> str:
        """The minimum version that the slot's content sets; "" = none."""
        found = "" if slot == BASE else read_table(self.path(slot) / COMPLETE).get("min_version", "")
        return found if isinstance(found, str) else ""

    def empty_one(self) -> Path:
        """An empty slot to install into: the one that neither runs nor is what one would go back to."""
        current = self.read()
        if current.probing:
            raise SlotError(f"version {current.version} is being tried: no other one is installed meanwhile")
        slot = "b" if current.slot == "a" else "a"
        folder = self.path(slot)
        remove_file(folder / COMPLETE, calls=self._calls)
        try:
            if folder.is_symlink():
                raise SlotError(f"{folder} is a link")
            if folder.exists():
                shutil.rmtree(folder)
            folder.mkdir(mode=0o700, parents=True)
        except OSError as error:
            raise SlotError(f"cannot empty {folder}: {error.strerror or error}") from error
        return folder

    def seal(self, folder: Path, facts: dict[str, Any]) -> None:
        """All is in the slot: `facts` has its `version`."""
        try:
            sync_all(folder)
        except OSError as error:
            raise SlotError(f"cannot sync {folder}: {error.strerror or error}") from error
        replace_table(folder / COMPLETE, facts, calls=self._calls)

    def switch(self, folder: Path, version: str) -> None:
        """The next start is that slot's, on trial; from now on."""
        current = self.read()
        if not self.complete(folder.name, version):
            raise SlotError(f"{folder} does not hold {version}")
        self._write(
            replace(
                current,
                slot=folder.name,
                version=version,
                state="probing",
                boots=0,
                previous=current.slot,
                previous_version=current.version,
            )
        )

    def boot(self, *, most: int) -> Current:
        """What to start now. A start of a version on trial is counted first: after `most` of them it is taken back.

        A start that cannot be counted is not made: then it is what ran before, whatever the disk says.
        """
        current = self.read()
        if current.probing and current.boots >= most:
            current = self.roll_back(current, f"it ended {most} times before it was kept")
        if not self.complete(current.slot, current.version):
            current = self.roll_back(current, f"slot {current.slot} does not hold it")
        if not current.probing:
            return current
        counted = replace(current, boots=current.boots + 1)
        try:
            self._write(counted)
        except SlotError:
            return self.roll_back(current, "its starts cannot be counted on this disk")
        return counted

    def uncount_boot(self) -> None:
        """The start ended because somebody asked it to: it says nothing about the version."""
        current = self.read()
        if current.probing and current.boots:
            self._write(replace(current, boots=current.boots - 1))

    def mark_good(self) -> None:
        """What runs has proved itself."""
        current = self.read()
        if current.probing:
            kept = replace(current, state="good", boots=0, failed_version="", failed_reason="")
            self._write(kept)

    def roll_back(self, current: Current, reason: str) -> Current:
        """Go back to what ran before, or to the base install where that is not whole; what is in force now.

        Where the disk refuses that holds for this start alone.
        """
        whole = current.previous != current.slot and self.complete(current.previous, current.previous_version)
        slot, version = (current.previous, current.previous_version) if whole else (BASE, "")
        older = Current(slot=slot, version=version, failed_version=current.version or BASE, failed_reason=reason[:500])
        with contextlib.suppress(SlotError):
            self._write(older)
        return older

    def _write(self, current: Current) -> None:
        replace_table(self.folder / "current", {"format": _FORMAT, **asdict(current)}, calls=self._calls)


def python_of(folder: Path) -> Path:
    """The interpreter of the environment in a slot or a bundle's folder."""
    return folder / "venv" / ("Scripts/python.exe" if sys.platform == "win32" else "bin/python")
