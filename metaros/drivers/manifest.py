"""A driver kind's `manifest.toml`, read and checked.

kind = "ld19"                     the folder's name
name = "LD06 / LD19 lidar"        as people call it
summary = "..."                   one sentence
quality = "silver"                see QUALITIES
requires = ["pyserial"]           distributions, each importable as `modules` says
modules = ["serial"]
extra = "drivers"                 the extra of metaros that brings them
platforms = ["linux", "macos", "windows"]
stale_after_s = 2.0               without a reading for so long it is reported stale; 0: never
[[publishes]] [[subscribes]] [[services]]   topic (or name), type, qos, summary
[[parameters]]                    name, type, default, minimum, maximum, choices, unit, local, live, summary
"""

from __future__ import annotations

import difflib
import sys
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final

from metaros.errors import ConfigError

__all__ = ["PLATFORMS", "QUALITIES", "Endpoint", "Manifest", "Parameter", "read_manifest"]

QUALITIES: Final[Mapping[str, str]] = {
    "bronze": "its protocol is tested against bytes we wrote from its specification",
    "silver": "it is tested against a real peer or a byte-true emulator, with garbage, unplugging and replugging",
    "gold": "the same, and it ran on the real device for a day",
}
PLATFORMS: Final[Mapping[str, str]] = {"linux": "linux", "macos": "darwin", "windows": "win32"}
_TYPES: Final[Mapping[str, type[Any]]] = {"text": str, "integer": int, "number": float, "flag": bool}


@dataclass(frozen=True, slots=True, kw_only=True)
class Endpoint:
    """A topic or a service of the driver, relative to its namespace; `{parameter}` stands for that parameter."""

    topic: str
    type: str
    qos: str = "default"
    summary: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter:
    """A parameter. `local`: only this machine's own command line or table may set it, never a remote caller.
    `live`: a change is obeyed at once; others are read when the driver is configured.
    """

    name: str
    type: str
    default: Any
    summary: str
    minimum: float | None = None
    maximum: float | None = None
    choices: tuple[Any, ...] = ()
    unit: str = ""
    local: bool = False
    live: bool = False

    @property
    def python_type(self) -> Callable[[Any], Any]:
        """str, int, float or bool."""
        return _TYPES[self.type]


COMMON: Final = (
    Parameter(
        name="allow_faults",
        type="flag",
        default=False,
        local=True,
        summary="Whether `~/fault` may simulate faults: unplug, silent, garble, clear.",
    ),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Manifest:
    """One kind of driver."""

    kind: str
    name: str
    summary: str
    quality: str
    requires: tuple[str, ...] = ()
    modules: tuple[str, ...] = ()
    extra: str = "drivers"
    platforms: tuple[str, ...] = tuple(PLATFORMS)
    stale_after_s: float = 2.0
    publishes: tuple[Endpoint, ...] = ()
    subscribes: tuple[Endpoint, ...] = ()
    services: tuple[Endpoint, ...] = ()
    parameters: tuple[Parameter, ...] = field(default=())

    def parameter(self, name: str) -> Parameter:
        """The parameter of that name; ConfigError says which there are."""
        for parameter in self.parameters:
            if parameter.name == name:
                return parameter
        near = difflib.get_close_matches(name, [p.name for p in self.parameters], n=1)
        hint = f"did you mean {near[0]!r}?" if near else f"there are {', '.join(p.name for p in self.parameters)}"
        raise ConfigError(f"{self.kind}: no parameter {name!r}; {hint}")

    @property
    def runs_here(self) -> bool:
        """Whether this platform is one of its own."""
        return sys.platform in {PLATFORMS[name] for name in self.platforms}

    def missing(self) -> tuple[str, ...]:
        """The modules it needs that are not installed; nothing is imported for it."""
        return tuple(name for name in self.modules if find_spec(name) is None)

    def check_runnable(self) -> None:
        """Raise ConfigError where this machine cannot run it, saying what to install."""
        if not self.runs_here:
            raise ConfigError(f"{self.kind}: it runs on {', '.join(self.platforms)}, not on {sys.platform}")
        if missing := self.missing():
            raise ConfigError(
                f"{self.kind}: missing Python modules: {', '.join(missing)}\n"
                f"install them with: pip install 'metaros[{self.extra}]'"
            )


def read_manifest(path: Path) -> Manifest:
    """Read and check a manifest. Raises ConfigError that names the file and the key."""
    try:
        tree = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror}") from None
    except (UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise ConfigError(f"{path}: {error}") from None
    where = f"{path.parent.name}/{path.name}"
    tables: dict[str, Any] = {}
    for key in ("publishes", "subscribes", "services"):
        tables[key] = tuple(_made(Endpoint, row, f"{where}: [[{key}]]") for row in tree.pop(key, ()))
    own = tuple(_parameter(row, where) for row in tree.pop("parameters", ()))
    manifest: Manifest = _made(Manifest, {**tree, **tables, "parameters": (*own, *COMMON)}, where)
    _check(manifest, path, where)
    return manifest


def _made(shape: type[Any], row: Mapping[str, Any], where: str) -> Any:
    known = {item.name for item in fields(shape)}
    if unknown := set(row) - known:
        raise ConfigError(f"{where}: unknown key {', '.join(sorted(unknown))}; there are {', '.join(sorted(known))}")
    try:
        return shape(**{key: tuple(value) if isinstance(value, list) else value for key, value in row.items()})
    except TypeError as error:
        raise ConfigError(f"{where}: {error}") from None


def _parameter(row: Mapping[str, Any], where: str) -> Parameter:
    parameter: Parameter = _made(Parameter, row, f"{where}: [[parameters]] {row.get('name', '')}")
    if parameter.type not in _TYPES:
        raise ConfigError(f"{where}: {parameter.name}: type {parameter.type!r} is none of {', '.join(_TYPES)}")
    kind = parameter.python_type
    if not (type(parameter.default) is kind or (kind is float and type(parameter.default) is int)):
        raise ConfigError(f"{where}: {parameter.name}: default {parameter.default!r} is no {parameter.type}")
    return parameter


def _check(manifest: Manifest, path: Path, where: str) -> None:
    if manifest.kind != path.parent.name:
        raise ConfigError(f"{where}: kind is {manifest.kind!r}, the folder {path.parent.name!r}")
    if manifest.quality not in QUALITIES:
        raise ConfigError(f"{where}: quality {manifest.quality!r} is none of {', '.join(QUALITIES)}")
    if unknown := set(manifest.platforms) - set(PLATFORMS):
        raise ConfigError(f"{where}: platforms {', '.join(sorted(unknown))}: none of {', '.join(PLATFORMS)}")
    names = [parameter.name for parameter in manifest.parameters]
    if len(set(names)) != len(names):
        raise ConfigError(f"{where}: a parameter is there twice")
