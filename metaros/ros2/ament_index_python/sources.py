"""Packages that are run from their source, without being installed: their own folder stands for the installation.

Such a package is a folder with a `package.xml` that says its name: one that was added, or one that the program being
run lies in. What its `setup.py` would copy to the share folder is looked for where it is in the source.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Final

__all__ = ["add_source_folder", "source_of"]

_NAME: Final = re.compile(rb"<name>\s*([A-Za-z0-9][A-Za-z0-9_-]*)\s*</name>")
_UP: Final = 5  # folders above a program in which its package.xml is looked for
_LONGEST_XML: Final = 1 << 20

_added: list[Path] = []


def add_source_folder(folder: str | Path) -> None:
    """Let the package in this folder be found, and those in the folders right in it."""
    path = Path(folder).resolve()
    if path not in _added:
        _added.append(path)


def source_of(package_name: str) -> Path | None:
    """The folder of a package that is here as source, or None."""
    for folder in _folders():
        if _named(folder) == package_name:
            return folder
    return None


def _folders() -> Iterator[Path]:
    for folder in _added:
        yield folder
        if folder.is_dir():
            yield from (path for path in sorted(folder.iterdir()) if path.is_dir())
    program = getattr(sys.modules.get("__main__"), "__file__", None)
    if program:
        yield from Path(program).resolve().parents[:_UP]


def _named(folder: Path) -> str | None:
    """What the package.xml of this folder calls it."""
    try:
        with (folder / "package.xml").open("rb") as file:
            found = _NAME.search(file.read(_LONGEST_XML))
    except OSError:
        return None
    return None if found is None else found[1].decode()
