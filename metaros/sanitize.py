"""Text from outside, made harmless where people read it: on a terminal, in JSON lines, in logs.

Names come from robots and people; one must neither colour the screen, nor begin a new row, nor turn another round.
"""

from __future__ import annotations

import json
import logging

__all__ = ["SanitizingFormatter", "sanitize", "sanitize_json", "sanitize_lines"]


class SanitizingFormatter(logging.Formatter):
    """A record is one line, whatever is in it; a traceback follows it, set in, so that no line of it looks like one."""

    def formatMessage(self, record: logging.LogRecord) -> str:
        """The line itself."""
        return sanitize(super().formatMessage(record))

    def formatException(self, ei: object) -> str:
        """The traceback; what an error says may come from outside, too."""
        return _set_in(super().formatException(ei))  # type: ignore[arg-type]  # as logging calls it

    def formatStack(self, stack_info: str) -> str:
        """The stack that somebody asked for."""
        return _set_in(super().formatStack(stack_info))


def sanitize(text: str) -> str:
    """The text with what a terminal obeys, or shows as something else, written out: `\\x1b`, `\\n`, `\\u202e`."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def sanitize_lines(text: str) -> str:
    """The same for a text that may have several lines, as errors with their advice have."""
    return "\n".join(map(sanitize, text.split("\n")))


def sanitize_json(document: str) -> str:
    """A JSON document that says the same, with all that cannot be printed written as `\\uXXXX`.

    json.dumps without ensure_ascii leaves C1 controls and marks of direction as they are, and half surrogates,
    which no stream takes.
    """
    if document.isprintable():
        return document
    return "".join(c if c.isprintable() or c in "\n\t" else json.dumps(c)[1:-1] for c in document)


def _set_in(text: str) -> str:
    return "\n".join(f"  {sanitize(line)}" for line in text.split("\n"))
