"""What the frames mean, by a DBC file (read by cantools): names and values of the signals that were asked for."""

from __future__ import annotations

import re
from collections.abc import Iterator
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, Final

import cantools

from metaros.errors import ConfigError

__all__ = ["MAX_SIGNALS", "Signals"]

MAX_SIGNALS: Final = 500
_TOPIC_PART: Final = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")


class Signals:
    """`patterns`: such as `Motor/*, EEC1/EngineSpeed`. ConfigError: a file or pattern that cannot work."""

    def __init__(self, path: str, patterns: str) -> None:
        try:
            database: Any = cantools.database.load_file(Path(path))
        except (OSError, UnicodeDecodeError, cantools.Error) as error:
            raise ConfigError(f"can: dbc: {path}: {error}") from None
        wanted = [pattern.strip() for pattern in patterns.split(",") if pattern.strip()]
        self._messages: dict[tuple[int, bool], tuple[Any, frozenset[str]]] = {}
        self.names: list[str] = []
        for message in database.messages:
            chosen = [one.name for one in message.signals if _is_wanted(f"{message.name}/{one.name}", wanted)]
            if chosen and not message.is_container:
                self._messages[message.frame_id, message.is_extended_frame] = (message, frozenset(chosen))
                self.names += [f"{message.name}/{name}" for name in chosen]
        if not self.names:
            raise ConfigError(f"can: signals: no signal of {path} is one of {patterns!r}")
        if len(self.names) > MAX_SIGNALS:
            raise ConfigError(f"can: signals: {len(self.names)} are asked for, of at most {MAX_SIGNALS}")

    def values(self, identifier: int, *, extended: bool, data: bytes) -> Iterator[tuple[str, float]]:
        """Name and value of each signal in a frame. ValueError: the frame does not fit the file."""
        message, chosen = self._messages.get((identifier, extended), (None, frozenset()))
        if message is None:
            return
        try:
            found = message.decode(data, decode_choices=False)
        except (cantools.Error, ValueError, OverflowError) as error:
            raise ValueError(f"{message.name}: {error}") from None
        for name, value in found.items():
            if name in chosen and isinstance(value, int | float):
                yield f"{message.name}/{name}", float(value)


def _is_wanted(name: str, patterns: list[str]) -> bool:
    return all(map(_TOPIC_PART.fullmatch, name.split("/"))) and any(fnmatchcase(name, one) for one in patterns)
