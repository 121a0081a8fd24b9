"""The [black_box] table of the agent's settings: how much is kept, and of which topics."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, Literal

from metaros.errors import ConfigError, MetarosError
from metaros.idl.globs import Glob
from metaros.limits import LIMITS

__all__ = ["BlackBoxSettings", "black_box_settings"]

_MOST_MINUTES = 24 * 60
_LEAST_BYTES = 1 << 20


@dataclass(frozen=True, slots=True, kw_only=True)
class BlackBoxSettings:
    """Bounds of the ring in recorded time and in bytes; it takes `topics` less `exclude`, both patterns.

    `keep` says where it is: in memory until something happens, or always on disk.
    """

    enabled: bool = True
    keep: Literal["memory", "disk"] = "memory"
    memory_bytes: int = LIMITS.black_box_memory_bytes
    minutes: float = 5.0
    quota_bytes: int = LIMITS.black_box_bytes
    topics: tuple[str, ...] = ("**",)
    exclude: tuple[str, ...] = ()


def black_box_settings(table: dict[str, Any], where: str) -> BlackBoxSettings:
    """The table, checked; ConfigError names key and file."""
    known = {item.name for item in fields(BlackBoxSettings)}
    for key in table:
        if key not in known:
            raise ConfigError(f"{where}: unknown key black_box.{key}; known are {', '.join(sorted(known))}")
    values = dict(table)
    if not isinstance(values.get("enabled", True), bool):
        raise ConfigError(f"{where}: black_box.enabled must be bool, not {values['enabled']!r}")
    if values.get("keep", "memory") not in ("memory", "disk"):
        raise ConfigError(f"{where}: black_box.keep must be memory or disk, not {values['keep']!r}")
    _check_number(values, "memory_bytes", (int,), _LEAST_BYTES, 1 << 40, where)
    _check_number(values, "minutes", (int, float), 0.1, _MOST_MINUTES, where)
    _check_number(values, "quota_bytes", (int,), _LEAST_BYTES, 1 << 50, where)
    for key in ("topics", "exclude"):
        if key in values:
            values[key] = _patterns(values[key], key, where)
    return BlackBoxSettings(**values)


def _check_number(
    values: dict[str, Any], key: str, kinds: tuple[type, ...], least: float, most: float, where: str
) -> None:
    """A number within its bounds, if it is there."""
    value: Any = values.get(key, least)
    is_number = isinstance(value, kinds) and not isinstance(value, bool)
    if not is_number or not least <= value <= most:
        raise ConfigError(f"{where}: black_box.{key} must be a number from {least:g} to {most:g}, not {value!r}")


def _patterns(value: Any, key: str, where: str) -> tuple[str, ...]:
    """A list of topic patterns."""
    if not isinstance(value, (list, tuple)) or not all(isinstance(item, str) for item in value):
        raise ConfigError(f"{where}: black_box.{key} must be a list of patterns, not {value!r}")
    for pattern in value:
        try:
            Glob(pattern)
        except MetarosError as error:
            raise ConfigError(f"{where}: black_box.{key}: {error}") from error
    return tuple(value)
