"""Where launch descriptions come from: Python launch files."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType
from typing import Any

from metaros.ros2.launch.entities import LaunchDescription
from metaros.ros2.launch.substitution import SomeSubstitutionsType, perform_substitutions

__all__ = [
    "AnyLaunchDescriptionSource",
    "FrontendLaunchDescriptionSource",
    "InvalidPythonLaunchFileError",
    "PythonLaunchDescriptionSource",
    "as_source",
    "get_launch_description_from_python_launch_file",
    "load_python_launch_file_as_module",
]


class InvalidPythonLaunchFileError(Exception):
    """A file that is no Python launch file."""


def load_python_launch_file_as_module(python_launch_file_path: str) -> ModuleType:
    """Run the file, as a module that nobody else sees."""
    path = Path(python_launch_file_path)
    if not path.is_file():
        raise InvalidPythonLaunchFileError(f"there is no launch file {path}")
    if path.suffix != ".py":
        raise InvalidPythonLaunchFileError(f"{path}: launch files in Python alone are understood, not {path.suffix}")
    spec = importlib.util.spec_from_file_location("python_launch_file", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def get_launch_description_from_python_launch_file(python_launch_file_path: str) -> LaunchDescription:
    """What its `generate_launch_description()` returns."""
    module = load_python_launch_file_as_module(python_launch_file_path)
    if not hasattr(module, "generate_launch_description"):
        raise InvalidPythonLaunchFileError(f"{python_launch_file_path} has no generate_launch_description()")
    found: LaunchDescription = module.generate_launch_description()
    return found


class LaunchDescriptionSource:
    """A description that is there."""

    def __init__(
        self, launch_description: LaunchDescription | None = None, location: SomeSubstitutionsType = ""
    ) -> None:
        self._location = location
        self._found = launch_description

    def get_launch_description(self, context: Any) -> LaunchDescription:
        """The description; `locals` say from now on which file this is."""
        if self._location:
            path = Path(perform_substitutions(context, self._location)).absolute()
            context.locals.current_launch_file_path = str(path)
            context.locals.current_launch_file_directory = str(path.parent)
            if self._found is None:
                self._found = get_launch_description_from_python_launch_file(str(path))
        assert self._found is not None
        return self._found

    def try_get_launch_description_without_context(self) -> LaunchDescription | None:
        """The description where it is known without a launch."""
        if self._found is None and isinstance(self._location, (str, Path)):
            return get_launch_description_from_python_launch_file(str(self._location))
        return self._found

    @property
    def location(self) -> str:
        """The file, as far as it is known."""
        return str(self._location)


class PythonLaunchDescriptionSource(LaunchDescriptionSource):
    """A launch file in Python."""

    def __init__(self, launch_file_path: SomeSubstitutionsType) -> None:
        super().__init__(None, launch_file_path)


class AnyLaunchDescriptionSource(PythonLaunchDescriptionSource):
    """The same: XML and YAML are not understood, and said so."""


FrontendLaunchDescriptionSource = AnyLaunchDescriptionSource


def as_source(found: Any) -> LaunchDescriptionSource:
    """A source, a description or a path as a source."""
    if isinstance(found, LaunchDescriptionSource):
        return found
    if isinstance(found, LaunchDescription):
        return LaunchDescriptionSource(found)
    return AnyLaunchDescriptionSource(found)
