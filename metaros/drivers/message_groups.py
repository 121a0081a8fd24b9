"""Groups messages that belong together, such as the sentences of one GPS fix, without a time-out. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

__all__ = ["MessageGroups"]


class MessageGroups:
    """Devices send a fixed series of messages again and again, and no end mark. What ended the last group is taken to
    end this one too, so that a group is returned with its last message, not with the first of the next.
    """

    def __init__(self) -> None:
        self._items: dict[str, Any] = {}
        self._moment: object = None
        self._latest = ""
        self._last = ""
        self._given = False

    def feed(self, kind: str, value: Any, *, moment: object = None) -> Iterator[Mapping[str, Any]]:
        """Add a message; yields groups that are now complete. Another `moment` or a repeated kind begins a new one."""
        other = moment is not None and self._moment is not None and moment != self._moment
        if self._items and (other or kind in self._items):
            yield from self.flush()
            self._last = self._latest
            self._items, self._moment, self._given = {}, None, False
        self._items[kind] = value
        self._moment = self._moment if moment is None else moment
        self._latest = kind
        if kind == self._last:
            yield from self.flush()

    def flush(self) -> Iterator[Mapping[str, Any]]:
        """The group so far, unless it was returned already: when the device falls silent."""
        if self._items and not self._given:
            self._given = True
            yield self._items
