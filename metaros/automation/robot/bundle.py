"""A function's package as a node's bundle, to be signed and published like any other.

    python -m metaros.robot_functions.bundle FOLDER_OR_ZIP --version 1.0.0 --out dock-1.0.0.zip

The zip file is in it as it is, the very bytes that the gateway takes; a folder is packed first, always into the same
bytes. The program that runs it is the robot's own.
"""

from __future__ import annotations

import argparse
import io
import sys
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from metaros.automation.functions.package import check_zip
from metaros.automation.robot.manifest import FILE, RobotFunction, parse_function
from metaros.automation.robot.program import BUNDLED
from metaros.errors import ConfigError, MetarosError
from metaros.fleet.bundle import read_bundle, target_path
from metaros.limits import LIMITS, Limits

__all__ = ["make_bundle", "pack_function"]

ENTRY: Final = "metaros.robot_functions.program:bundled"  # signed: robots of older and newer versions run it
_SKIPPED: Final = ("__pycache__", ".git", ".venv", ".mypy_cache", ".ruff_cache", ".pytest_cache")
_EPOCH: Final = (1980, 1, 1, 0, 0, 0)


def pack_function(folder: Path, *, limits: Limits = LIMITS) -> bytes:
    """A folder as the zip file that gateway and robot take; the same files are always the same bytes.

    Raises:
        ConfigError: there is no good `function.yaml` in it.
        PackageError: it is too large, or has files that no package may have.
    """
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in sorted(path for path in folder.rglob("*") if path.is_file()):
            place = path.relative_to(folder)
            if not set(place.parts) & set(_SKIPPED):
                info = zipfile.ZipInfo(place.as_posix(), _EPOCH)
                info.compress_type = zipfile.ZIP_DEFLATED
                info.external_attr = 0o100644 << 16
                archive.writestr(info, path.read_bytes())
    data = buffer.getvalue()
    _described(data, limits)
    return data


def make_bundle(source: Path, target: Path, *, version: str, limits: Limits = LIMITS) -> Path:
    """The bundle of a folder or zip file, at `target`; it has the function's name.

    Raises:
        ConfigError: there is no good `function.yaml` in it.
        PackageError: the code is no package of a function.
        BundleError: the version is none.
    """
    data = pack_function(source, limits=limits) if source.is_dir() else source.read_bytes()
    name = _described(data, limits).name
    target_path("node", name, version)
    said = f'format = 1\nname = "{name}"\nkind = "node"\nversion = "{version}"\nentry = "{ENTRY}"\n'
    with zipfile.ZipFile(target, "w", zipfile.ZIP_STORED) as archive:
        archive.writestr("bundle.toml", said)
        archive.writestr(BUNDLED, data)
    read_bundle(target)
    return target


def _described(data: bytes, limits: Limits) -> RobotFunction:
    """What a zip file says of itself."""
    if FILE not in check_zip(data, limits=limits).names:
        raise ConfigError(f"there is no {FILE} at its root")
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        return parse_function(archive.read(FILE), limits=limits)


def main(arguments: Sequence[str] | None = None) -> int:
    """0 where the bundle was made."""
    parser = argparse.ArgumentParser(prog="python -m metaros.robot_functions.bundle", allow_abbrev=False)
    parser.add_argument("package", type=Path, help="the function's folder or zip file")
    parser.add_argument("--version", required=True, help="two to four numbers: 1.2.0")
    parser.add_argument("--out", type=Path, required=True, help="the bundle's file")
    options = parser.parse_args(arguments)
    try:
        made = make_bundle(options.package, options.out, version=options.version)
    except (MetarosError, OSError) as error:
        sys.stderr.write(f"{options.package}: {error}\n")
        return 1
    sys.stdout.write(f"{made}\n")
    return 0
