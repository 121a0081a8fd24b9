"""From a line of text to numbers by name. Pure."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Mapping
from typing import Any, Final

from metaros.errors import ConfigError

__all__ = ["MAX_FIELDS", "SKIPPED", "LineReader", "field_names", "line_reader"]

MAX_FIELDS: Final = 64
SKIPPED: Final = "-"
_NAME: Final = re.compile(r"[A-Za-z]\w{0,63}(\.[A-Za-z]\w{0,63}){0,7}\Z", re.ASCII)
_BETWEEN: Final = re.compile(r"[ \t]*[,;][ \t]*|[ \t]+")

LineReader = Callable[[str], Mapping[str, float]]


def field_names(text: str, *, columns: bool) -> tuple[str, ...]:
    """The names between commas; ConfigError: none, too many, twice, or no name. `columns`: `-` is allowed."""
    names = tuple(name.strip() for name in text.split(","))
    named = [name for name in names if not (columns and name == SKIPPED)]
    if not named or len(names) > MAX_FIELDS or len(set(named)) != len(named):
        raise ConfigError(f"serial_sensor: fields: expected 1 to {MAX_FIELDS} different names, not {text!r}")
    for name in named:
        if not _NAME.match(name):
            raise ConfigError(
                f"serial_sensor: fields: {name!r}: a name has letters, digits and _, and begins with a letter"
            )
    return names


def line_reader(form: str, names: tuple[str, ...], pattern: str) -> LineReader:
    """What reads one line: the numbers that it has; ValueError where it is no line of this form at all."""
    if form == "json":
        return lambda line: _of_json(line, names)
    if form == "csv":
        return lambda line: _of_columns(line, names)
    try:
        compiled = re.compile(pattern)
    except (re.error, RecursionError, OverflowError) as error:
        raise ConfigError(f"serial_sensor: pattern: {error}") from None
    if missing := [name for name in names if name not in compiled.groupindex]:
        raise ConfigError(f"serial_sensor: pattern: it has no group (?P<{missing[0]}>...)")
    return lambda line: _of_pattern(line, names, compiled)


def _of_columns(line: str, names: tuple[str, ...]) -> dict[str, float]:
    columns = _BETWEEN.split(line.strip())
    if len(columns) < len(names):
        raise ValueError("too few columns")
    return _numbers({name: text for name, text in zip(names, columns, strict=False) if name != SKIPPED})


def _of_json(line: str, names: tuple[str, ...]) -> dict[str, float]:
    try:
        tree = json.loads(line)
    except RecursionError:
        raise ValueError("nested too deep") from None
    if not isinstance(tree, dict):
        raise ValueError("no object")
    return _numbers({name: _within(tree, name) for name in names})


def _within(tree: Any, name: str) -> Any:
    for part in name.split("."):
        tree = tree.get(part) if isinstance(tree, dict) else None
    return tree


def _of_pattern(line: str, names: tuple[str, ...], pattern: re.Pattern[str]) -> dict[str, float]:
    found = pattern.search(line)
    if found is None:
        raise ValueError("no match")
    return _numbers({name: found[name] for name in names})


def _numbers(values: Mapping[str, Any]) -> dict[str, float]:
    """Those that are finite numbers; what JSON calls true is 1."""
    numbers = {}
    for name, value in values.items():
        try:
            number = float(value)
        except (TypeError, ValueError, OverflowError):
            continue
        if math.isfinite(number):
            numbers[name] = number
    return numbers
