"""STATUSTEXT messages of the autopilot, into the driver's log."""

from __future__ import annotations

from typing import Any, Final

from metaros.drivers.context import DriverContext

__all__ = ["StatusTextLog"]

_CHUNK: Final = 50
_MOST_CHUNKS: Final = 5
_BURST: Final = 20
_PER_S: Final = 2.0


class StatusTextLog:
    """Long texts come in chunks. A talkative one is cut to _PER_S lines a second; the others are counted."""

    def __init__(self, context: DriverContext) -> None:
        self._context = context
        self._begun: tuple[int, list[str]] = (0, [])
        self._left = float(_BURST)
        self._reported_s = context.clock.monotonic_s()

    def on_text(self, message: Any) -> None:
        """STATUSTEXT; severities 0 to 3 are errors, 4 is a warning."""
        text, number = str(message.text), message.id
        begun, chunks = self._begun
        chunks = [*chunks, text] if number and number == begun else [text]
        if number and len(text) == _CHUNK and len(chunks) < _MOST_CHUNKS:
            self._begun = (number, chunks)
            return
        self._begun = (0, [])
        self._report(message.severity, "".join(chunks))

    def _report(self, severity: int, text: str) -> None:
        now_s = self._context.clock.monotonic_s()
        self._left = min(float(_BURST), self._left + _PER_S * (now_s - self._reported_s))
        self._reported_s = now_s
        if self._left < 1:
            self._context.count("untold_texts")
            return
        self._left -= 1
        line = "vehicle: " + "".join(letter if letter.isprintable() else "?" for letter in text)
        log = self._context.log
        (log.error if severity <= 3 else log.warn if severity == 4 else log.info)(line)
