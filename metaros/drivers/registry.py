"""The kinds of drivers there are: every folder here that has a manifest."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Final, cast

from metaros.drivers.manifest import Manifest, read_manifest
from metaros.errors import ConfigError

if TYPE_CHECKING:
    from metaros.drivers.context import Device, DriverContext
    from metaros.drivers.probing import Found

    Maker = Callable[[DriverContext], Device]

__all__ = ["FOLDER", "all_manifests", "device_maker", "driver_kinds", "maker_in", "manifest_of", "probe", "prober"]

FOLDER: Final = Path(__file__).resolve().parent


@cache
def driver_kinds() -> tuple[str, ...]:
    """The kinds there are, by name."""
    return tuple(sorted(path.parent.name for path in FOLDER.glob("[a-z]*/manifest.toml")))


@cache
def manifest_of(kind: str) -> Manifest:
    """The manifest of a kind; ConfigError where there is none."""
    if kind not in driver_kinds():
        raise ConfigError(f"no driver {kind!r}; there are {', '.join(driver_kinds())}")
    return read_manifest(FOLDER / kind / "manifest.toml")


def all_manifests() -> tuple[Manifest, ...]:
    """Every kind's manifest."""
    return tuple(manifest_of(kind) for kind in driver_kinds())


def device_maker(kind: str) -> Maker:
    """`make` of the kind's module `driver`; ConfigError where this machine lacks what it needs."""
    manifest_of(kind).check_runnable()
    module = importlib.import_module(f"metaros.drivers.{kind}.driver")
    return cast("Maker", module.make)


def maker_in(folder: Path) -> tuple[Manifest, Maker]:
    """A kind of somebody's own: a folder with `manifest.toml` and `driver.py`, imported as the package it is.

    ConfigError where there is none, or its name belongs to another package.
    """
    folder = folder.resolve()
    manifest = read_manifest(folder / "manifest.toml")
    manifest.check_runnable()
    if not folder.name.isidentifier() or not (folder / "driver.py").is_file():
        raise ConfigError(f"{folder}: expected a folder named like a Python package, with a driver.py in it")
    if str(folder.parent) not in sys.path:
        sys.path.insert(0, str(folder.parent))
    importlib.invalidate_caches()
    try:
        module = importlib.import_module(f"{folder.name}.driver")
    except ModuleNotFoundError as error:
        raise ConfigError(f"{folder / 'driver.py'}: {error}; is its folder's name that of another package?") from None
    if module.__file__ is None or Path(module.__file__).resolve() != folder / "driver.py":
        raise ConfigError(f"{folder}: its name is that of another package, {module.__file__}; give it one of its own")
    if not callable(getattr(module, "make", None)):
        raise ConfigError(f"{folder / 'driver.py'}: it has no make(context)")
    return manifest, cast("Maker", module.make)


def prober(kind: str) -> Callable[[], Sequence[Found]] | None:
    """`find` of the kind's module `probe`; None where it has none, or its libraries are not installed."""
    if not (FOLDER / kind / "probe.py").is_file() or manifest_of(kind).missing() or not manifest_of(kind).runs_here:
        return None
    module: ModuleType = importlib.import_module(f"metaros.drivers.{kind}.probe")
    return cast("Callable[[], Sequence[Found]]", module.find)


def probe(manifests: Sequence[Manifest]) -> Iterator[tuple[Manifest, Sequence[Found]]]:
    """Look for devices of these kinds, one kind after the other; a kind without a probe finds nothing.

    Probes only look (lists of devices, USB ids): none sends bytes to a device that it does not know.
    """
    for manifest in manifests:
        find = prober(manifest.kind)
        yield manifest, tuple(find()) if find is not None else ()
