"""Files that viewers may fetch: of one directory, by an allow-list, and nothing that a link leads to."""

from __future__ import annotations

import os
import re
import stat
from pathlib import Path

from gateway.api.foxglove.errors import AssetError
from metaros.limits import LIMITS

__all__ = ["SUFFIXES", "read_asset"]

_MODELS = (".stl", ".dae", ".obj", ".mtl", ".glb", ".gltf", ".bin", ".urdf", ".sdf")
_PICTURES = (".png", ".jpg", ".jpeg", ".webp", ".gif", ".tif", ".tiff", ".pgm", ".svg", ".yaml")
SUFFIXES = frozenset((*_MODELS, *_PICTURES))
SCHEMES = ("package://", "asset:///")
_PART = re.compile(r"[A-Za-z0-9_+@ -][A-Za-z0-9_.+@ -]*")  # no dot first: nothing hidden, and no way up


def read_asset(folder: Path | None, uri: str) -> bytes:
    """The file of a URI, `package://PKG/meshes/arm.stl` or `asset:///map.png`; run it on a thread.

    Raises:
        AssetError: there is none that may be fetched; the reason names no file that is not allowed.
    """
    if folder is None:
        raise AssetError("this gateway has no --assets-dir: there is nothing to fetch")
    path = _inside(folder, uri)
    try:
        descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0))
    except OSError:
        raise AssetError("there is no such file") from None
    try:
        facts = os.fstat(descriptor)
        if not stat.S_ISREG(facts.st_mode):
            raise AssetError("there is no such file")
        if facts.st_size > LIMITS.asset_bytes:
            raise AssetError(f"the file has {facts.st_size} bytes, at most {LIMITS.asset_bytes} can be fetched")
        with os.fdopen(descriptor, "rb", closefd=False) as file:
            return file.read(LIMITS.asset_bytes)
    finally:
        os.close(descriptor)


def _inside(folder: Path, uri: str) -> Path:
    """The real path; a link anywhere on the way has to stay inside."""
    scheme = next((item for item in SCHEMES if uri.startswith(item)), None)
    if scheme is None:
        raise AssetError(f"a URI begins with {' or '.join(SCHEMES)}")
    parts = uri.removeprefix(scheme).split("/")
    if not all(_PART.fullmatch(part) for part in parts):
        raise AssetError("a path has letters, digits and _ . + @ - in its parts, none of which begins with a dot")
    if Path(parts[-1]).suffix.lower() not in SUFFIXES:
        raise AssetError(f"only files of these kinds can be fetched: {' '.join(sorted(SUFFIXES))}")
    root = folder.resolve()
    path = root.joinpath(*parts).resolve()
    if not path.is_relative_to(root):
        raise AssetError("there is no such file")
    return path
