"""How a handler's log leaves the worker: one frame a message on a descriptor of its own, so that messages keep their
bounds; lines on stdout where there is none.
"""

from __future__ import annotations

import json
import logging
import os
import sys
import time
import traceback
from typing import Any

from metaros.clock import SystemClock

__all__ = ["LogSink", "Logged", "set_up_logging"]

_DATE = "%Y-%m-%dT%H:%M:%S"
_LINE = "[%(levelname)s]\t%(asctime)s.%(msecs)03dZ\t%(aws_request_id)s\t%(message)s\n"
_FRAME = 0xA55A0002  # the bit for text and the level are added to it
_TEXT = 1
_CLOCK = SystemClock()
_KNOWN = frozenset(vars(logging.makeLogRecord({}))) | {"message", "asctime", "aws_request_id", "taskName"}


class LogSink:
    """Messages out: `_LAMBDA_TELEMETRY_LOG_FD` says where to, and is hidden from the handler."""

    def __init__(self) -> None:
        fd = os.environ.pop("_LAMBDA_TELEMETRY_LOG_FD", "")
        self._fd = int(fd) if fd else None

    def write(self, message: str, *, level: int = logging.NOTSET, text: bool = True) -> None:
        """One message."""
        if self._fd is None:
            sys.stdout.write(message)
            sys.stdout.flush()
            return
        body = message.encode("utf-8", "backslashreplace")
        step = min(50, max(0, level)) // 10
        kind = _FRAME | (_TEXT if text else 0) | (step + 1 << 2 if step else 0)
        stamp_us = _CLOCK.wall_ns() // 1000
        frame = kind.to_bytes(4, "big") + len(body).to_bytes(4, "big") + stamp_us.to_bytes(8, "big") + body
        while frame:
            frame = frame[os.write(self._fd, frame) :]


class Logged:
    """What the log says of the call under way."""

    request_id = ""


class _Handler(logging.Handler):
    def __init__(self, sink: LogSink, *, as_json: bool) -> None:
        super().__init__()
        self._sink, self._as_json = sink, as_json
        if not as_json:
            formatter = logging.Formatter(_LINE, _DATE)
            formatter.converter = time.gmtime
            self.setFormatter(formatter)

    def emit(self, record: logging.LogRecord) -> None:
        record.aws_request_id = Logged.request_id
        message = _json_of(record) if self._as_json else self.format(record)
        self._sink.write(message, level=record.levelno, text=not self._as_json)


def _json_of(record: logging.LogRecord) -> str:
    plain = isinstance(record.msg, dict) and not record.args
    fields: dict[str, Any] = {
        "timestamp": time.strftime(_DATE + "Z", time.gmtime(record.created)),
        "level": record.levelname,
        "message": record.msg if plain else record.getMessage(),
        "logger": record.name,
    }
    if record.exc_info and record.exc_info[0]:
        fields["stackTrace"] = traceback.format_tb(record.exc_info[2])
        fields["errorType"] = record.exc_info[0].__name__
        fields["errorMessage"] = str(record.exc_info[1])
        fields["location"] = f"{record.pathname}:{record.funcName}:{record.lineno}"
    if Logged.request_id:
        fields["requestId"] = Logged.request_id
    extras = {k: v for k, v in vars(record).items() if k not in _KNOWN and k not in fields}
    return json.dumps(fields | extras, ensure_ascii=False, default=str) + "\n"


def set_up_logging(sink: LogSink) -> None:
    """The root logger writes to `sink`, as `AWS_LAMBDA_LOG_FORMAT` and `AWS_LAMBDA_LOG_LEVEL` ask."""
    as_json = os.environ.get("AWS_LAMBDA_LOG_FORMAT", "").upper() == "JSON"
    level = os.environ.get("AWS_LAMBDA_LOG_LEVEL", "").upper()
    level = {"TRACE": "DEBUG", "FATAL": "CRITICAL"}.get(level, level)
    root = logging.getLogger()
    root.addHandler(_Handler(sink, as_json=as_json))
    if level in logging.getLevelNamesMapping():
        root.setLevel(level)
