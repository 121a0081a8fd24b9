"""JSON that somebody gives on the command line: itself, `@FILE`, or `-` for standard input; and `NAME=VALUE`."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from gateway.automation.functions.example_events import EXAMPLE_EVENTS
from metaros.errors import UsageError
from metaros.limits import LIMITS

__all__ = ["given_json", "payload_of", "variables"]


def given_json(text: str, flag: str) -> Any:
    """What the text says, or the file or input that it names."""
    source = text
    try:
        if text == "-":
            source = sys.stdin.read(LIMITS.function_payload_bytes + 1)
        elif text.startswith("@"):
            source = Path(text[1:]).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError(f"{flag} {text}: {error}") from error
    try:
        return json.loads(source)
    except ValueError as error:
        raise UsageError(f"{flag}: no JSON: {error}") from None


def payload_of(data: str, event: str) -> Any:
    """What a function is called with: `--data`, an event of the table, or an empty object."""
    if data and event:
        raise UsageError("say either --data or --event")
    if not event:
        return given_json(data, "--data") if data else {}
    if event not in EXAMPLE_EVENTS:
        raise UsageError(f"there is no event {event}; there are {', '.join(EXAMPLE_EVENTS)}")
    return EXAMPLE_EVENTS[event].event


def variables(said: Sequence[str]) -> dict[str, str]:
    """`NAME=VALUE` of `--env`."""
    found: dict[str, str] = {}
    for text in said:
        name, sign, value = text.partition("=")
        if not sign or not name:
            raise UsageError(f"--env {text}: not NAME=VALUE")
        found[name] = value
    return found
