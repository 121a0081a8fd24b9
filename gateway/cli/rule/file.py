"""Rules in a file: YAML or JSON, one rule, a list of them, `rules: [...]`, or several YAML documents."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import yaml

from metaros.errors import UsageError

__all__ = ["read_rules"]

MOST_BYTES = 4 * 1024 * 1024
STDIN = Path("-")


def read_rules(path: Path) -> list[dict[str, Any]]:
    """Every rule of the file, each with a name. UsageError says what is none. What it means, the gateway checks."""
    try:
        if path == STDIN:
            text = sys.stdin.read(MOST_BYTES + 1)
        else:
            with path.open(encoding="utf-8") as file:
                text = file.read(MOST_BYTES + 1)
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError(f"{path}: {error}") from error
    if len(text) > MOST_BYTES:
        raise UsageError(f"{path}: more than {MOST_BYTES} characters")
    try:
        documents = [one for one in yaml.safe_load_all(text) if one is not None]
    except yaml.YAMLError as error:
        raise UsageError(f"{path}: neither YAML nor JSON: {error}") from error
    found: list[Any] = []
    for document in documents:
        if isinstance(document, dict) and set(document) == {"rules"}:
            document = document["rules"]
        found += document if isinstance(document, list) else [document]
    for place, rule in enumerate(found):
        if not isinstance(rule, dict) or not isinstance(rule.get("name"), str):
            raise UsageError(f"{path}: rule {place + 1} of {len(found)} has no name")
    if not found:
        raise UsageError(f"{path}: there is no rule in it")
    return found
