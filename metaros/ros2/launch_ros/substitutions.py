"""Where packages and their executables are."""

from __future__ import annotations

from typing import Any

from metaros.errors import ConfigError
from metaros.ros2.ament_index_python.packages import get_package_prefix, get_package_share_directory
from metaros.ros2.launch.substitution import SomeSubstitutionsType, Substitution, perform_substitutions
from metaros.ros2.launch.substitutions import PathJoinSubstitution, SubstitutionFailure
from metaros.ros2.programs.stand_ins import executable_file

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


class ExecutableInPackage(FindPackage):
    """An executable of a package, built or in source."""

    def __init__(self, executable: SomeSubstitutionsType, package: SomeSubstitutionsType) -> None:
        super().__init__(package)
        self.executable = executable

    def perform(self, context: Any) -> str:
        """The path of a file that runs it."""
        package, name = (perform_substitutions(context, part) for part in (self.package, self.executable))
        try:
            return str(executable_file(package, name, context.environment))
        except ConfigError as error:
            raise SubstitutionFailure(str(error)) from None
