"""Bundles for tests: real zip files, small."""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from pathlib import Path

from tests.support.deployment.zips import member

__all__ = ["WHEEL", "make_bundle"]

WHEEL = "wheels/lidar_node-1.0.0-py3-none-any.whl"


def make_bundle(
    folder: Path,
    *,
    name: str = "lidar-node",
    version: str = "1.0.0",
    kind: str = "node",
    extra: str = "",
    members: Mapping[str, bytes] | None = None,
    manifest: str | None = None,
) -> Path:
    """A bundle's file; `extra` is put into its bundle.toml, `manifest` instead of all of it."""
    entry = 'entry = "lidar_node.main:main"\n' if kind == "node" and "command" not in extra else ""
    said = f'format = 1\nname = "{name}"\nkind = "{kind}"\nversion = "{version}"\n{entry}{extra}'
    files = members if members is not None else {WHEEL: f"wheel of {version}".encode()}
    path = folder / f"{name}-{version}.zip"
    folder.mkdir(parents=True, exist_ok=True)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(member("bundle.toml"), said if manifest is None else manifest)
        for inside, content in files.items():
            archive.writestr(member(inside), content)
    return path
