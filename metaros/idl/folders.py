"""Interfaces from folders: `METAROS_INTERFACE_PATH` and, of a ROS 2 installation, `AMENT_PREFIX_PATH`.

    METAROS_INTERFACE_PATH=/home/me/interfaces     interfaces/my_msgs/msg/Own.msg is my_msgs/msg/Own
    AMENT_PREFIX_PATH=/opt/ros/jazzy               jazzy/share/nav2_msgs/action/Spin.action is nav2_msgs/action/Spin

Several folders stand with `:` between them, the first one wins. A folder of `METAROS_INTERFACE_PATH` may also be a
package itself, or an install prefix. Files are found when a package is first asked for, and read when their type is.
Shipped definitions win over those of an installation; the program's own folders win over shipped ones, which is logged
where they differ, and not for the packages that nodes themselves are made of. A bad file is logged, and named in the
error of who asks for its type. `.idl` files are left alone: rosidl puts the `.msg` beside them.
"""

from __future__ import annotations

import logging
import os
import re
from collections.abc import Callable, Iterator
from itertools import islice
from pathlib import Path
from typing import Final

from metaros.errors import DefinitionError
from metaros.idl.definitions import Definition
from metaros.idl.parser import MAX_TEXT_CHARS, parse_action, parse_msg, parse_srv
from metaros.limits import LIMITS

__all__ = ["INSTALLED", "OWN", "Folders", "interface_file"]

OWN: Final = "METAROS_INTERFACE_PATH"
INSTALLED: Final = "AMENT_PREFIX_PATH"

_log = logging.getLogger("metaros.idl")
_NODES_OWN: Final = frozenset(
    (
        "action_msgs",
        "builtin_interfaces",
        "lifecycle_msgs",
        "metaros_msgs",
        "rcl_interfaces",
        "rosgraph_msgs",
        "service_msgs",
        "type_description_interfaces",
        "unique_identifier_msgs",
    )
)
_KINDS: Final[dict[str, Callable[[str, str], Definition]]] = {
    "msg": parse_msg,
    "srv": parse_srv,
    "action": parse_action,
}
_PACKAGE: Final = re.compile(r"[a-z][a-z0-9_]{0,127}\Z")
_NAME: Final = re.compile(r"[A-Z][A-Za-z0-9_]{0,127}\Z")


class Folders:
    """What a catalogue takes from the folders. Not thread-safe: the catalogue's lock guards it."""

    def __init__(self) -> None:
        self.bad: dict[str, str] = {}  # why what a file defines cannot be used
        self._told: set[str] = set()
        self._files: dict[tuple[str, str], dict[str, Path]] = {}

    def choose(self, name: str, shipped: Definition | None) -> Definition | None:
        """The definition of `name`: the program's own, the shipped one, an installation's, or None."""
        own = self._read(name, OWN)
        if own is not None and shipped is not None and own != shipped:
            path = self._of(name.partition("/")[0], OWN)[name]
            if name.partition("/")[0] in _NODES_OWN:
                self._tell(f"{path} is not used: it differs from the {name} that nodes are made of")
                return shipped
            self._tell(f"{path} is used for {name}; it differs from the shipped one, which others may have")
        if own is not None or shipped is not None:
            return own or shipped
        return self._read(name, INSTALLED)

    def names(self, package: str = "") -> list[str]:
        """The interfaces of a package, or of all packages."""
        found: list[str] = []
        for variable in (OWN, INSTALLED):
            for item in [package] if package else _packages(variable):
                found += (name for name in self._of(item, variable) if name not in self.bad)
        return found

    def _of(self, package: str, variable: str) -> dict[str, Path]:
        files = self._files.get((package, variable))
        if files is None:
            files = _package_files(package, variable)
            if files:  # what is not there is not remembered: strangers ask for any name
                self._files[package, variable] = files
        return files

    def _read(self, name: str, variable: str) -> Definition | None:
        path = self._of(name.partition("/")[0], variable).get(name)
        if path is None:
            return None
        try:
            found = _read_file(name, path)
        except DefinitionError as error:
            self.bad[name] = str(error)
            self._tell(self.bad[name])
            return None
        self.bad.pop(name, None)
        return found

    def _tell(self, text: str) -> None:
        if text not in self._told:
            self._told.add(text)
            _log.warning("%s", text)


def _package_files(package: str, variable: str) -> dict[str, Path]:
    """The interfaces of a package in the folders of `variable` (`OWN` or `INSTALLED`), by full name.

    At most `LIMITS.type_cache` files of each kind and folder are looked at.
    """
    found: dict[str, Path] = {}
    if not _PACKAGE.match(package):
        return found
    for root in reversed(list(_roots(variable))):
        for folder in _homes(root, package, variable):
            for kind in _KINDS:
                for path in _entries(folder / kind):
                    if path.suffix == f".{kind}" and _NAME.match(path.stem):
                        found[f"{package}/{kind}/{path.stem}"] = path
    return found


def _packages(variable: str) -> list[str]:
    """The names of all packages with interfaces in the folders of `variable`."""
    found: set[str] = set()
    for root in _roots(variable):
        above = [root / "share"] if variable == INSTALLED else [root, root / "share"]
        found.update(path.name for folder in above for path in _entries(folder) if _has_interfaces(path))
        if variable == OWN and _has_interfaces(root):
            found.add(root.name)
    return sorted(name for name in found if _PACKAGE.match(name))


def interface_file(name: str) -> Path | None:
    """The file of an interface, by its full name."""
    package = name.partition("/")[0]
    found = (_package_files(package, variable).get(name) for variable in (OWN, INSTALLED))
    return next((path for path in found if path is not None), None)


def _read_file(name: str, path: Path) -> Definition:
    """The interface that a file defines; `DefinitionError` names the file and, of its text, the line."""
    try:
        with path.open("rb") as file:
            data = file.read(4 * MAX_TEXT_CHARS + 1)
        text = data.decode("utf-8")
        if len(data) > 4 * MAX_TEXT_CHARS:
            raise DefinitionError(f"more than {MAX_TEXT_CHARS} characters")
        return _KINDS[name.split("/")[1]](text, name)
    except UnicodeDecodeError:
        raise DefinitionError(f"{path}: the text is not UTF-8") from None
    except OSError as error:
        raise DefinitionError(f"{path}: {error.strerror}") from None
    except DefinitionError as error:
        raise DefinitionError(f"{path}: {error}") from None


def _roots(variable: str) -> Iterator[Path]:
    for text in islice(filter(None, os.environ.get(variable, "").split(os.pathsep)), LIMITS.type_cache):
        yield Path(text)


def _homes(root: Path, package: str, variable: str) -> Iterator[Path]:
    """Where below a folder a package may be; the later the stronger."""
    yield root / "share" / package
    if variable == OWN:
        yield root / package
        if root.name == package:
            yield root


def _has_interfaces(folder: Path) -> bool:
    return any((folder / kind).is_dir() for kind in _KINDS)


def _entries(folder: Path) -> list[Path]:
    try:
        with os.scandir(folder) as entries:
            return [Path(entry.path) for entry in islice(entries, LIMITS.type_cache)]
    except OSError:  # most packages have one or two of the three folders
        return []
