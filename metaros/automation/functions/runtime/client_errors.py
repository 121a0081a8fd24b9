"""A handler's errors as AWS reports them: the error's document, its cause for X-Ray, and its lines in the log."""

from __future__ import annotations

import json
import os
import traceback
from types import TracebackType
from typing import Any

__all__ = ["Failure", "Fault"]

_CAUSE_BYTES = 1024 * 1024  # larger causes are left out, as AWS's client does
_OURS = os.path.dirname(os.path.abspath(__file__))


class Fault(Exception):
    """What the runtime finds wrong with the function; `kind` is AWS's name for it."""

    def __init__(self, kind: str, message: str, *, trace: list[str] | None = None) -> None:
        super().__init__(message)
        self.kind = kind
        self.trace = trace or []


class Failure:
    """An exception, as it is reported to the Runtime API."""

    def __init__(self, error: BaseException, *, request_id: str = "") -> None:
        if isinstance(error, Fault):
            self.kind, frames, self.trace = error.kind, traceback.StackSummary(), error.trace
        else:
            self.kind, frames = type(error).__name__, _frames(error.__traceback__)
            self.trace = traceback.format_list(frames)
        self.message = str(error)
        self.request_id = request_id
        self._frames = frames

    @property
    def document(self) -> dict[str, Any]:
        """What the caller gets."""
        return {
            "errorMessage": self.message,
            "errorType": self.kind,
            "requestId": self.request_id,
            "stackTrace": self.trace,
        }

    @property
    def cause(self) -> str:
        """What X-Ray gets, in one line of ASCII; "" where it is too large for a header."""
        stack = [{"label": f.name, "path": f.filename, "line": f.lineno} for f in self._frames]
        text = json.dumps(
            {
                "working_directory": os.getcwd(),
                "exceptions": [{"message": self.message, "type": self.kind, "stack": stack}],
                "paths": sorted({f.filename for f in self._frames}),
            }
        )
        return text if len(text) < _CAUSE_BYTES else ""

    @property
    def text(self) -> str:
        """What the log gets."""
        lines = [f"[ERROR] {self.kind}: {self.message}" if self.message else f"[ERROR] {self.kind}"]
        if self.trace:
            lines.append("Traceback (most recent call last):")
        return "\n".join(lines) + "\n" + "".join(self.trace)


def _frames(tb: TracebackType | None) -> traceback.StackSummary:
    """The handler's own frames: those of this client are left out at their head."""
    frames = traceback.extract_tb(tb)
    first = next((i for i, f in enumerate(frames) if os.path.dirname(f.filename) != _OURS), 0)
    return traceback.StackSummary.from_list(frames[first:])
