"""Log lines in the terminal, as the RCUTILS_* variables of ROS 2 want them.

RCUTILS_CONSOLE_OUTPUT_FORMAT     "[{severity}] [{time}] [{name}]: {message}"
RCUTILS_COLORIZED_OUTPUT          1 or 0; without it colours go to terminals alone
RCUTILS_LOGGING_USE_STDOUT        1 for stdout instead of stderr
RCUTILS_LOGGING_BUFFERED_STREAM   1 leaves it to the stream when lines are written out
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable, Mapping
from typing import Final, NamedTuple

__all__ = ["Console", "Record"]

_DEFAULT: Final = "[{severity}] [{time}] [{name}]: {message}"
_LONGEST_FORMAT: Final = 2048
_TOKEN: Final = re.compile(r"\{([a-z_]+)\}")
_ESCAPES: Final = {"\\a": "\a", "\\b": "\b", "\\n": "\n", "\\r": "\r", "\\t": "\t"}
_COLOURS: Final = {"DEBUG": "\033[32m", "INFO": "\033[0m", "WARN": "\033[33m", "ERROR": "\033[31m", "FATAL": "\033[31m"}
_PLAIN: Final = "\033[0m"


class Record(NamedTuple):
    """One message and where it comes from."""

    severity: str
    name: str
    message: str
    stamp_ns: int
    function: str
    file: str
    line: int


def _seconds(record: Record) -> str:
    seconds, nanoseconds = divmod(record.stamp_ns, 1_000_000_000)
    return f"{seconds:010d}.{nanoseconds:09d}"


def _date(record: Record) -> str:
    from datetime import datetime  # few formats want it

    milliseconds = record.stamp_ns // 1_000_000
    date = datetime.fromtimestamp(milliseconds // 1000)  # by this machine's zone, as in rcutils
    return f"{date:%Y-%m-%d %H:%M:%S}.{milliseconds % 1000:03d}"


_PARTS: Final[dict[str, Callable[[Record], str]]] = {
    "severity": lambda record: record.severity,
    "name": lambda record: record.name,
    "message": lambda record: record.message,
    "function_name": lambda record: record.function,
    "file_name": lambda record: record.file,
    "line_number": lambda record: str(record.line),
    "time": _seconds,
    "time_as_nanoseconds": lambda record: f"{record.stamp_ns:019d}",
    "date_time_with_ms": _date,
}


class Console:
    """Writes records; `environ` stands in for the process's environment, which is read once."""

    def __init__(self, environ: Mapping[str, str] | None = None) -> None:
        environ = os.environ if environ is None else environ
        text = environ.get("RCUTILS_CONSOLE_OUTPUT_FORMAT") or _DEFAULT
        for escape, character in _ESCAPES.items():
            text = text.replace(escape, character)
        self._format = text[:_LONGEST_FORMAT]
        self._colours = _flag(environ, "RCUTILS_COLORIZED_OUTPUT")
        self._stdout = _flag(environ, "RCUTILS_LOGGING_USE_STDOUT")
        self._buffered = _flag(environ, "RCUTILS_LOGGING_BUFFERED_STREAM")

    def line(self, record: Record, *, coloured: bool = False) -> str:
        """The record as one line of text."""
        text = _TOKEN.sub(lambda match: _PARTS[match[1]](record) if match[1] in _PARTS else match[0], self._format)
        return f"{_COLOURS[record.severity]}{text}{_PLAIN}" if coloured and record.severity in _COLOURS else text

    def write(self, record: Record) -> None:
        """Write it, in one piece, so that lines of several threads stay whole."""
        stream = sys.stdout if self._stdout else sys.stderr
        if stream is None:  # a program without a terminal
            return
        coloured = stream.isatty() if self._colours is None else self._colours
        stream.write(f"{self.line(record, coloured=coloured)}\n")
        if not self._buffered:
            stream.flush()


def _flag(environ: Mapping[str, str], name: str) -> bool | None:
    """None where it is not set; ValueError where it is neither 0 nor 1."""
    text = environ.get(name, "")
    if text not in ("", "0", "1"):
        raise ValueError(f"{name} is {text[:80]!r}: 0 or 1 is expected")
    return text == "1" if text else None
