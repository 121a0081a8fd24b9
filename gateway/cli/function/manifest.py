"""`function.yaml` beside a function's code: its name and settings, so that nobody has to say them each time."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import yaml

from gateway.cli.function.pack import Packed
from metaros.errors import UsageError

__all__ = ["MANIFEST", "handler_of", "read_manifest"]

MANIFEST = "function.yaml"
LAMBDA_MODULE = "lambda_function"  # what AWS's own console begins with
MOST_BYTES = 64 * 1024
Fits = Callable[[Any], bool]
FIELDS: Mapping[str, tuple[Fits, str]] = {
    "name": (lambda value: isinstance(value, str), "a text"),
    "handler": (lambda value: isinstance(value, str), "a text like app.handler"),
    "description": (lambda value: isinstance(value, str), "a text"),
    "timeout_s": (lambda value: _number(value) and value >= 1, "seconds, 1 or more"),
    "memory_mb": (lambda value: isinstance(value, int) and value >= 128, "a whole number, 128 or more"),
    "environment": (
        lambda value: isinstance(value, dict) and all(isinstance(one, str) for pair in value.items() for one in pair),
        "names with texts",
    ),
}


def read_manifest(source: Path) -> dict[str, Any]:
    """What it says of `FIELDS`; nothing where there is none. What it says of robots' functions is not for here."""
    path = source / MANIFEST
    if not path.is_file():
        return {}
    try:
        with path.open("rb") as file:
            said = yaml.safe_load(file.read(MOST_BYTES + 1)[:MOST_BYTES])
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise UsageError(f"{path}: no YAML: {error}") from error
    if not isinstance(said, dict):
        raise UsageError(f"{path}: it has fields like name and handler")
    for name, (fits, words) in FIELDS.items():
        if name in said and not fits(said[name]):
            raise UsageError(f"{path}: {name} is {words}")
    found = {name: said[name] for name in FIELDS if name in said}
    if "timeout_s" in found:
        found["timeout_s"] = math.ceil(found["timeout_s"])  # gateways count whole seconds, as AWS does
    return found


def handler_of(packed: Packed, source: Path) -> str:
    """The handler of code that names none: of `app.py`, of AWS's own `lambda_function.py`, or of the only module."""
    if "app" in packed.modules:
        return "app.handler"
    if LAMBDA_MODULE in packed.modules:
        return f"{LAMBDA_MODULE}.lambda_handler"
    if len(packed.modules) == 1:
        return f"{packed.modules[0]}.handler"
    raise UsageError(f"{source}: which function handles events?\nsay --handler MODULE.FUNCTION")


def _number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
