"""A Python environment of a bundle's own, made of its wheels and of nothing from any network.

What the wheels do not bring comes from the robot's base install, after them: so an agent's bundle may be the one wheel
of `metaros`, and a node's needs none of it. The base install is the loader's own; it is never replaced.
"""

from __future__ import annotations

import os
import subprocess
import sys
import sysconfig
from collections.abc import Mapping, Sequence
from pathlib import Path

import metaros
from edge_agent.update.errors import SlotError, UpdateInstallError
from edge_agent.update.slots import python_of
from metaros.limits import LIMITS

__all__ = ["BASE_PYTHON", "BASE_SITE", "base_places", "make_environment"]

BASE_PYTHON = "METAROS_BASE_PYTHON"  # in the environment of what the loader started
BASE_SITE = "METAROS_BASE_SITE"
_PTH = "zz_metaros_base.pth"  # after everything that is in the environment itself


def base_places() -> list[str]:
    """Where the base install's packages are, for the program that runs from it."""
    found = [sysconfig.get_path("purelib"), sysconfig.get_path("platlib"), str(Path(metaros.__file__).parents[1])]
    return list(dict.fromkeys(found))


def make_environment(folder: Path, *, environ: Mapping[str, str] = os.environ) -> Path:
    """`venv` in the folder, with the wheels of `wheels` in it; its interpreter. Blocks for minutes on a small robot.

    Raises:
        UpdateInstallError: there is no pip, or it does not install the wheels.
    """
    base = environ.get(BASE_PYTHON) or sys.executable
    places = environ[BASE_SITE].split(os.pathsep) if BASE_SITE in environ else base_places()
    own_pip = _run([base, "-I", "-c", "import pip"], environ, must=False) == 0
    _run([base, "-I", "-m", "venv", *(["--without-pip"] if own_pip else []), str(folder / "venv")], environ)
    python = python_of(folder)
    pip = [base, "-I", "-m", "pip", "--python", str(python)] if own_pip else [str(python), "-I", "-m", "pip"]
    wheels = sorted((folder / "wheels").glob("*.whl"))
    options = ["--no-index", "--no-deps", "--no-cache-dir", "--disable-pip-version-check", "--only-binary", ":all:"]
    if wheels:
        _run([*pip, "install", "--quiet", *options, *map(str, wheels)], environ)
    site = _site_of(python, environ)
    try:
        (site / _PTH).write_text("".join(f"{place}\n" for place in places))
    except OSError as error:
        raise SlotError(f"cannot write {site}: {error.strerror}") from error
    return python


def _site_of(python: Path, environ: Mapping[str, str]) -> Path:
    code = "import sysconfig; print(sysconfig.get_path('purelib'))"
    done = subprocess.run([python, "-I", "-c", code], capture_output=True, text=True, check=False, env=_clean(environ))
    if done.returncode:
        raise UpdateInstallError(f"its Python does not run: {done.stderr.strip()[-300:]}")
    return Path(done.stdout.strip())


def _run(argv: Sequence[str], environ: Mapping[str, str], *, must: bool = True) -> int:
    """Run it to its end, with nothing of the caller's settings for Python and pip."""
    try:
        done = subprocess.run(
            list(argv),
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            errors="replace",
            timeout=LIMITS.update_install_s,
            check=False,
            env=_clean(environ),
        )
    except subprocess.TimeoutExpired as error:
        raise UpdateInstallError(f"making its environment took over {LIMITS.update_install_s:g} s") from error
    except OSError as error:
        raise UpdateInstallError(f"{argv[0]} does not run: {error.strerror}") from error
    if must and done.returncode:
        said = "; ".join((done.stderr or done.stdout).strip().splitlines()[-3:])
        raise UpdateInstallError(f"its environment cannot be made: {said[-400:]}")
    return done.returncode


def _clean(environ: Mapping[str, str]) -> dict[str, str]:
    kept = {name: value for name, value in environ.items() if not name.upper().startswith(("PYTHON", "PIP_"))}
    return {**kept, "PIP_CONFIG_FILE": os.devnull}
