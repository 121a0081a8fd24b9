"""The kinds of drivers there are: every folder here that has a manifest."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Final, cast

from metaros.drivers.manifest import Manifest, read_manifest
from metaros.errors import ConfigError

if TYPE_CHECKING:
    from metaros.drivers.probing import Found
    from metaros.drivers.unit import Device, Unit

__all__ = ["FOLDER", "all_manifests", "device_maker", "driver_kinds", "manifest_of", "prober"]

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


def device_maker(kind: str) -> Callable[[Unit], Device]:
    """`make` of the kind's module `driver`; ConfigError where this machine lacks what it needs."""
    manifest_of(kind).check_runnable()
    module = importlib.import_module(f"metaros.drivers.{kind}.driver")
    return cast("Callable[[Unit], Device]", module.make)


def prober(kind: str) -> Callable[[], Sequence[Found]] | None:
    """`find` of the kind's module `probe`; None where it has none, or its libraries are not installed."""
    if not (FOLDER / kind / "probe.py").is_file() or manifest_of(kind).missing() or not manifest_of(kind).runs_here:
        return None
    module: ModuleType = importlib.import_module(f"metaros.drivers.{kind}.probe")
    return cast("Callable[[], Sequence[Found]]", module.find)
