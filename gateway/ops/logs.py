"""The program's log: lines for people, or JSON objects for machines, with who asked and which request it was.

Whatever a line holds of robots, people or errors, it is one line, and harmless on a terminal.
"""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Callable, Iterator, Mapping
from contextvars import ContextVar
from datetime import UTC, datetime
from typing import Any, Final

import orjson

from metaros.sanitize import SanitizingFormatter, sanitize, sanitize_json

__all__ = ["FORMATS", "LEVELS", "JsonFormatter", "TextFormatter", "add_log_context", "log_context", "set_up_logs"]

FORMATS: Final = ("text", "json")
LEVELS: Final = ("debug", "info", "warning", "error")
_TEXT: Final = "%(asctime)s %(levelname)s %(name)s: %(message)s"
_FIELD_CHARS: Final = 256
_TRACE_CHARS: Final = 16_384
_WHO: ContextVar[Callable[[], Mapping[str, str]] | None] = ContextVar("metaros_log_facts", default=None)


@contextlib.contextmanager
def log_context(facts: Callable[[], Mapping[str, str]]) -> Iterator[None]:
    """Add these fields to what is logged inside, in tasks begun there too: request_id, principal, robot."""
    token = _WHO.set(facts)
    try:
        yield
    finally:
        _WHO.reset(token)


def add_log_context(facts: Callable[[], Mapping[str, str]]) -> None:
    """Add these fields to what is logged from here to the end of this task."""
    _WHO.set(facts)


class TextFormatter(SanitizingFormatter):
    """A line for people; the request's facts stand behind it."""

    def __init__(self) -> None:
        super().__init__(_TEXT)

    def formatMessage(self, record: logging.LogRecord) -> str:
        """The line itself."""
        facts = " ".join(f"{key}={value}" for key, value in _facts().items())
        return super().formatMessage(record) + (f" [{sanitize(facts)}]" if facts else "")


class JsonFormatter(logging.Formatter):
    """A line is a JSON object: time, level, logger, message, the request's facts, and the error where there is one."""

    def format(self, record: logging.LogRecord) -> str:
        """The object; what cannot be printed is escaped, so that it is one line of plain text."""
        at = datetime.fromtimestamp(record.created, UTC).isoformat(timespec="milliseconds")
        line: dict[str, Any] = {
            "time": at.replace("+00:00", "Z"),
            "level": record.levelname.lower(),
            "logger": record.name,
            "message": record.getMessage(),
            **_facts(),
        }
        if record.exc_info:
            line["error"] = self.formatException(record.exc_info)[-_TRACE_CHARS:]
        return sanitize_json(_json(line))


def set_up_logs(*, form: str = "text", level: str = "warning") -> None:
    """Send the whole program's log to standard error; `form` is one of FORMATS, `level` one of LEVELS."""
    handler = logging.StreamHandler()
    handler.setFormatter(JsonFormatter() if form == "json" else TextFormatter())
    logging.basicConfig(level=level.upper(), handlers=[handler])


def _facts() -> dict[str, str]:
    context = _WHO.get()
    if context is None:
        return {}
    return {key: value[:_FIELD_CHARS] for key, value in context().items() if value}


def _json(line: dict[str, Any]) -> str:
    try:
        return orjson.dumps(line).decode()
    except TypeError:  # half a surrogate pair, which no UTF-8 has
        clean = {key: value.encode("utf-8", "backslashreplace").decode() for key, value in line.items()}
        return orjson.dumps(clean).decode()
