"""NAME=VALUE arguments of the command line as a JSON object."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from metaros.errors import UsageError

__all__ = ["pairs"]


def pairs(fields: Sequence[str], *, shape: str, example: str) -> dict[str, Any]:
    """Values as JSON, else as text. UsageError names what is no pair, and an `example` of the `shape`."""
    found: dict[str, Any] = {}
    for text in fields:
        name, sign, value = text.partition("=")
        if not (sign and name):
            raise UsageError(f"{text}: not {shape}, as {example}")
        try:
            found[name] = json.loads(value)
        except ValueError:
            found[name] = value
    return found
