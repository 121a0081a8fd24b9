"""The node's logger: one line on stderr, one message on /rosout."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any, Final, TextIO

from metaros.clock import Clock

__all__ = ["Logger"]

LEVELS: Final = {"DEBUG": 10, "INFO": 20, "WARN": 30, "ERROR": 40, "FATAL": 50}


class Logger:
    """Messages at or above `level` go to stderr and, where the node has it, to /rosout. Thread-safe."""

    def __init__(
        self, name: str, clock: Clock, *, publish: Callable[..., None] | None = None, stream: TextIO | None = None
    ) -> None:
        self.name = name
        self.level = LEVELS["INFO"]
        self.on_stderr = True
        self._clock = clock
        self.rosout = publish  # what sends a message to /rosout; None where the node does not
        self._stream = stream

    def publish_with(self, publish: Callable[..., None]) -> None:
        """Send messages to /rosout, too, from now on."""
        self.rosout = publish

    def set_level(self, level: str) -> None:
        """Show `level` (DEBUG, INFO, WARN, ERROR, FATAL) and what is graver."""
        self.level = LEVELS[level.upper()]

    def debug(self, text: object) -> None:
        """For who looks for a fault."""
        self._log("DEBUG", text)

    def info(self, text: object) -> None:
        """What happens."""
        self._log("INFO", text)

    def warn(self, text: object) -> None:
        """What may become a fault."""
        self._log("WARN", text)

    warning = warn

    def error(self, text: object) -> None:
        """What failed."""
        self._log("ERROR", text)

    def fatal(self, text: object) -> None:
        """What ends the node."""
        self._log("FATAL", text)

    def _log(self, level: str, text: object) -> None:
        if LEVELS[level] < self.level:
            return
        stamp_ns = self._clock.wall_ns()
        line = f"[{level}] [{stamp_ns / 1e9:.6f}] [{self.name}]: {text}"
        if self.on_stderr:
            print(line, file=self._stream or sys.stderr, flush=True)
        if self.rosout is not None:
            frame: Any = sys._getframe(2)
            self.rosout(
                stamp_ns=stamp_ns,
                level=LEVELS[level],
                name=self.name,
                msg=str(text),
                file=frame.f_code.co_filename,
                function=frame.f_code.co_name,
                line=frame.f_lineno,
            )
