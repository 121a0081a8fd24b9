"""The Python of each peer: ours, an environment made under .make/peers/ from pinned requirements, or the system's."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

__all__ = ["HOMES", "Home", "HomeFailed", "python_of"]

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / ".make" / "peers"
_INSTALL_S = 600


class HomeFailed(Exception):
    """The peer cannot run here; the text is for its row."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Home:
    """Where a peer's libraries come from."""

    requirements: tuple[str, ...] = ()
    module: str = ""  # of the system's Python
    missing: str = ""


HOMES = {
    "ours": Home(),
    "peers": Home(requirements=("cyclonedds==11.0.1", "pyzmq==27.3.0")),
    # This name and version on PyPI are the earlier work; setuptools is what its setup.py is built with.
    "metaros1": Home(requirements=("metaros==1.1.5", "pyzmq==27.3.0", "numpy==2.4.6", "setuptools==84.2.1")),
    "river": Home(requirements=("river==0.26.1",)),  # for load_tests/anomaly
    "rospy": Home(
        module="rospy", missing="not installed (Debian: python3-rospy python3-rosmaster python3-sensor-msgs)"
    ),
}
_SYSTEM_PYTHONS = ("/usr/bin/python3", "python3")


def python_of(name: str, *, folder: Path = FOLDER) -> str:
    """The interpreter of a home, made at first; HomeFailed tells why there is none."""
    home = HOMES[name]
    if home.module:
        return _system_python(home)
    if not home.requirements:
        return sys.executable
    return _environment(folder / name, home.requirements)


def _system_python(home: Home) -> str:
    """The first of the system's interpreters that can import the module."""
    for candidate in _SYSTEM_PYTHONS:
        python = shutil.which(candidate)
        if (
            python
            and subprocess.run([python, "-P", "-c", f"import {home.module}"], capture_output=True).returncode == 0
        ):
            return python
    raise HomeFailed(home.missing)


def _environment(folder: Path, requirements: tuple[str, ...]) -> str:
    """A virtual environment with just these; made anew when they change."""
    python = folder / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    stamp, state = folder / "requirements", "\n".join((sys.version, *requirements))
    if python.exists() and stamp.exists() and stamp.read_text() == state:
        return str(python)
    shutil.rmtree(folder, ignore_errors=True)
    folder.parent.mkdir(parents=True, exist_ok=True)
    uv = shutil.which("uv", path=os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")]))
    if uv:
        steps = [
            [uv, "venv", "-q", "--python", sys.executable, str(folder)],
            [uv, "pip", "install", "-q", "--python", str(python), *requirements],
        ]
    else:
        steps = [
            [sys.executable, "-m", "venv", str(folder)],
            [str(python), "-m", "pip", "install", "-q", "--disable-pip-version-check", *requirements],
        ]
    for step in steps:
        _run(step)
    stamp.write_text(state)
    return str(python)


def _run(step: list[str]) -> None:
    try:
        done = subprocess.run(step, capture_output=True, text=True, timeout=_INSTALL_S)
    except (OSError, subprocess.TimeoutExpired) as error:
        raise HomeFailed(f"not installed: {error}") from None
    if done.returncode:
        last = (done.stderr or done.stdout).strip().splitlines()[-1:]
        raise HomeFailed(f"not installed: {''.join(last)[:200]}")
