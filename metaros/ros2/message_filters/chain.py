"""Filters one after the other, as one filter."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from metaros.ros2.message_filters.simple_filter import SimpleFilter

__all__ = ["Chain"]


@dataclass
class _Link:
    message_filter: Any
    connection: int


class Chain(SimpleFilter):
    """What comes in goes through the added filters in turn; what the last one puts out comes out.

    A filter in it has `add(message)`, as `Cache` has.
    """

    def __init__(self, message_filter: SimpleFilter | None = None) -> None:
        super().__init__()
        self.incoming_connection: int | None = None
        self._links: list[_Link] = []
        if message_filter is not None:
            self.connectInput(message_filter)

    def connectInput(self, message_filter: SimpleFilter) -> None:
        """Take what this filter puts out.

        Raises:
            RuntimeError: there is an input already.
        """
        if self.incoming_connection is not None:
            raise RuntimeError("Already connected")
        self.incoming_connection = message_filter.registerCallback(self.add)

    def add(self, message: Any) -> None:
        """Take a message in."""
        if self._links:
            self._links[0].message_filter.add(message)
        else:
            self.signalMessage(message)

    def addFilter(self, message_filter: Any) -> int:
        """Put a filter behind the last one; its index."""
        if self._links:
            last = self._links[-1]
            last.message_filter.callbacks.pop(last.connection)
            last.connection = last.message_filter.registerCallback(message_filter.add)
        self._links.append(_Link(message_filter, message_filter.registerCallback(self.signalMessage)))
        return len(self._links) - 1

    def getFilter(self, index: int) -> Any:
        """The filter of that index."""
        return self._links[index].message_filter
