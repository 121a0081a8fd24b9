"""Where packages and their executables are."""

from __future__ import annotations

import os
from typing import Any

from metaros.ros2.ament_index_python.packages import get_package_prefix, get_package_share_directory
from metaros.ros2.launch.substitution import SomeSubstitutionsType, Substitution, perform_substitutions
from metaros.ros2.launch.substitutions import PathJoinSubstitution, SubstitutionFailure

__all__ = ["ExecutableInPackage", "FindPackage", "FindPackagePrefix", "FindPackageShare"]


class FindPackage(Substitution):
    """A folder of a package."""

    def __init__(self, package: SomeSubstitutionsType) -> None:
        self.package = package

    def find(self, name: str) -> str:
        """The folder."""
        return str(get_package_prefix(name))

    def perform(self, context: Any) -> str:
        """The folder's path."""
        name = perform_substitutions(context, self.package)
        try:
            return self.find(name)
        except LookupError as error:
            raise SubstitutionFailure(str(error)) from None

    def __truediv__(self, part: SomeSubstitutionsType) -> PathJoinSubstitution:
        return PathJoinSubstitution([self, part])


class FindPackagePrefix(FindPackage):
    """Where the package is installed."""


class FindPackageShare(FindPackage):
    """Its `share` folder."""

    def find(self, name: str) -> str:
        """The folder."""
        return str(get_package_share_directory(name))


class ExecutableInPackage(FindPackagePrefix):
    """An executable of a package."""

    def __init__(self, executable: SomeSubstitutionsType, package: SomeSubstitutionsType) -> None:
        super().__init__(package)
        self.executable = executable

    def perform(self, context: Any) -> str:
        """Its path."""
        package, name = super().perform(context), perform_substitutions(context, self.executable)
        path = os.path.join(package, "lib", perform_substitutions(context, self.package), name)
        if not os.path.exists(path):
            raise SubstitutionFailure(f"there is no executable {name!r} at {path}")
        return path
