"""Cameras of this machine, without opening one: V4L2 lists them in sysfs; elsewhere numbers are tried by hand."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from metaros.drivers.probing import Found

__all__ = ["find"]


def find(root: Path = Path("/sys/class/video4linux")) -> Sequence[Found]:
    """One for each device whose first stream it is; others (metadata, second streams) are left out."""
    found = []
    for folder in sorted(root.glob("video*")):
        try:
            index, name = (folder / "index").read_text().strip(), (folder / "name").read_text().strip()
        except OSError:
            continue
        if index == "0":
            source = folder.name.removeprefix("video")
            found.append(Found(kind="camera", summary=name[:80], parameters={"source": source}, certain=True))
    return found
