"""Containers of bundles: the image comes signed inside the bundle, and an engine of this robot takes it.

Nothing is fetched from a registry: what runs is what was signed, named by its id.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from edge_agent.update.errors import UpdateForeignError, UpdateInstallError
from metaros.limits import LIMITS

__all__ = ["ENGINES", "find_engine", "forget_image", "load_image"]

ENGINES: Final = ("podman", "docker")  # the first that is there: podman needs no daemon and no root
_LOADED: Final = re.compile(r"Loaded image(?:\(s\)| ID)?: (\S+)")
_ID: Final = re.compile(r"(?:sha256:)?([0-9a-f]{64})\Z")
_FORGET_S: Final = 60.0


def find_engine() -> str:
    """The engine's program. Raises UpdateForeignError where this robot has none."""
    for name in ENGINES:
        if (found := shutil.which(name)) is not None:
            return os.path.abspath(found)  # a link stays one: its name says which engine the program plays
    raise UpdateForeignError(f"the bundle is a container, and this robot has no engine: {' or '.join(ENGINES)}")


def load_image(engine: str, archive: Path) -> str:
    """Give the engine an image; its id. Blocks. Raises UpdateInstallError."""
    said = _run([engine, "load", "--input", str(archive)])
    names = _LOADED.findall(said)
    if len(names) != 1:
        raise UpdateInstallError(f"{archive.name}: {engine} found {len(names)} images in it, and not one")
    found = _ID.search(_run([engine, "image", "inspect", "--format", "{{.Id}}", names[0]]).strip())
    if found is None:
        raise UpdateInstallError(f"{engine} does not say the id of {names[0][:100]}")
    return f"sha256:{found[1]}"


def forget_image(engine: str, image: str) -> None:
    """It may go; one that is used stays."""
    try:
        subprocess.run(
            [engine, "rmi", image], stdin=subprocess.DEVNULL, capture_output=True, timeout=_FORGET_S, check=False
        )
    except (OSError, subprocess.TimeoutExpired):
        return


def _run(argv: Sequence[str]) -> str:
    try:
        done = subprocess.run(
            argv,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            errors="replace",
            timeout=LIMITS.update_install_s,
            check=False,
        )
    except subprocess.TimeoutExpired as error:
        raise UpdateInstallError(f"{argv[0]} took over {LIMITS.update_install_s:g} s to {argv[1]}") from error
    except OSError as error:
        raise UpdateInstallError(f"{argv[0]} does not run: {error.strerror}") from error
    if done.returncode:
        said = "; ".join((done.stderr or done.stdout).strip().splitlines()[-3:])
        raise UpdateInstallError(f"{argv[0]} refuses to {argv[1]}: {said[-400:]}")
    return done.stdout
