"""Where packages are installed, and what they share."""

from __future__ import annotations

import re
import warnings
from pathlib import Path
from typing import Final

from metaros.ros2.ament_index_python.resources import get_resource, get_resources
from metaros.ros2.ament_index_python.search_paths import get_search_paths
from metaros.ros2.ament_index_python.sources import share_of, source_of

__all__ = [
    "PackageNotFoundError",
    "get_package_prefix",
    "get_package_share_directory",
    "get_package_share_path",
    "get_packages_with_prefixes",
]

_NAME: Final = re.compile(r"[a-zA-Z0-9][a-zA-Z0-9_-]+", re.ASCII)


class PackageNotFoundError(KeyError):
    """No prefix has the package, and it is not run from its source."""

    def __str__(self) -> str:
        return str(self.args[0]) if self.args else ""


def get_packages_with_prefixes() -> dict[str, str]:
    """All installed packages, each with its prefix."""
    return get_resources("packages")


def get_package_prefix(package_name: str) -> str:
    """The folder that a package is installed into; of one that is run from its source, that.

    Raises:
        PackageNotFoundError: it is not there.
        ValueError: that is no package's name.
    """
    if not _NAME.fullmatch(package_name):
        raise ValueError(f"'{package_name}' is not a valid package name")
    try:
        return get_resource("packages", package_name)[1]
    except (LookupError, OSError):
        source = source_of(package_name)
    if source is not None:
        return str(source)
    try:
        where = f"searching: {get_search_paths()}"
    except OSError:
        where = "AMENT_PREFIX_PATH is not set, and no package.xml of that name is near the program or here"
    raise PackageNotFoundError(f"package '{package_name}' not found, {where}")


def get_package_share_directory(package_name: str, print_warning: bool = True) -> str:
    """The share folder of a package; warns where it does not exist. Of one run from its source, the source.

    Raises:
        PackageNotFoundError, ValueError: as `get_package_prefix`.
    """
    return str(_share(package_name, print_warning))


def get_package_share_path(package_name: str, print_warning: bool = True) -> Path:
    """The same as a Path."""
    return _share(package_name, print_warning)


def _share(package_name: str, print_warning: bool) -> Path:
    prefix = Path(get_package_prefix(package_name))
    source = source_of(package_name)
    if source is not None and source == prefix:
        return share_of(source, package_name)
    share = prefix / "share" / package_name
    if print_warning and not share.exists():
        warnings.warn(f"Share directory for {package_name} ({share}) does not exist.", stacklevel=3)
    return share
