"""Resources of the index: a kind is a folder, a resource a file in it."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Literal

from metaros.ros2.ament_index_python.constants import RESOURCE_INDEX_SUBFOLDER
from metaros.ros2.ament_index_python.search_paths import get_search_paths

__all__ = [
    "InvalidResourceNameError",
    "InvalidResourceTypeNameError",
    "get_resource",
    "get_resource_types",
    "get_resources",
    "has_resource",
]


class InvalidResourceTypeNameError(ValueError):
    """The name of a kind has a path separator in it."""


class InvalidResourceNameError(ValueError):
    """The name of a resource has a path separator in it."""


def get_resource(resource_type: str, resource_name: str) -> tuple[str, str]:
    """A resource's text, and the prefix that has it.

    Raises:
        LookupError: no prefix has it.
        InvalidResourceTypeNameError, InvalidResourceNameError: a name is a path.
        OSError: it cannot be read, or AMENT_PREFIX_PATH is not set.
    """
    for prefix, path in _files(resource_type, resource_name):
        try:
            return path.read_text(), prefix
        except OSError as error:
            raise OSError(f"Could not open resource '{resource_name}' of type '{resource_type}': {error}") from error
    raise LookupError(f"Could not find the resource '{resource_name}' of type '{resource_type}'")


def has_resource(resource_type: str, resource_name: str) -> str | Literal[False]:
    """The prefix that has it, or False. Raises as `get_resource` for names that are paths."""
    for prefix, _ in _files(resource_type, resource_name):
        return prefix
    return False


def get_resources(resource_type: str) -> dict[str, str]:
    """All resources of a kind, each with the first prefix that has it."""
    _check(resource_type)
    found: dict[str, str] = {}
    for prefix in get_search_paths():
        for path in _inside(Path(prefix, RESOURCE_INDEX_SUBFOLDER, resource_type)):
            if not path.is_dir():
                found.setdefault(path.name, prefix)
    return found


def get_resource_types() -> set[str]:
    """All kinds that the prefixes have."""
    return {
        path.name
        for prefix in get_search_paths()
        for path in _inside(Path(prefix, RESOURCE_INDEX_SUBFOLDER))
        if path.is_dir()
    }


def _files(resource_type: str, resource_name: str) -> Iterator[tuple[str, Path]]:
    _check(resource_type)
    if not resource_name:
        raise AssertionError("The resource name must not be empty")
    if _is_path(resource_name):
        raise InvalidResourceNameError(f"Resource name '{resource_name}' is invalid: it is a path")
    for prefix in get_search_paths():
        path = Path(prefix, RESOURCE_INDEX_SUBFOLDER, resource_type, resource_name)
        if path.is_file():
            yield prefix, path


def _check(resource_type: str) -> None:
    if not resource_type:
        raise AssertionError("The resource type must not be empty")
    if _is_path(resource_type):
        raise InvalidResourceTypeNameError(f"Resource type '{resource_type}' is invalid: it is a path")


def _is_path(name: str) -> bool:
    return "/" in name or "\\" in name or name in (os.curdir, os.pardir)


def _inside(folder: Path) -> list[Path]:
    return [path for path in sorted(folder.iterdir()) if not path.name.startswith(".")] if folder.is_dir() else []
