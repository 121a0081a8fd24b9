"""The series that a robot's session announced, by number."""

from __future__ import annotations

from collections.abc import Iterable

from gateway.domain.channel import Series
from gateway.errors import ProtocolError
from gateway.ingest.handshake import read_series
from metaros._proto import link_pb2

__all__ = ["SeriesTable"]

REMEMBERED_SETS = 64  # of series that came together in a batch


class SeriesTable:
    """What each number stands for, once and for all."""

    def __init__(self) -> None:
        self._series: dict[int, Series] = {}
        self._sets: dict[tuple[int, ...], tuple[Series, ...]] = {}

    def __len__(self) -> int:
        return len(self._series)

    def announce(self, announced: Iterable[link_pb2.Series]) -> tuple[Series, ...]:
        """More of them, or some again; ProtocolError when a number had another meaning."""
        series = {item.series_id: read_series(item) for item in announced}
        for number, item in series.items():
            if self._series.setdefault(number, item).name != item.name:
                raise ProtocolError(f"series {number} was {self._series[number].name}, it cannot become {item.name}")
        return tuple(series.values())

    def together(self, numbers: tuple[int, ...]) -> tuple[Series, ...]:
        """Some of them: the very same tuple as last time, so that what others make of it can be kept, too.

        ProtocolError when one was not announced.
        """
        found = self._sets.get(numbers)
        if found is None:
            unknown = [number for number in numbers if number not in self._series]
            if unknown:
                raise ProtocolError(f"series {unknown[0]} was not announced")
            if len(self._sets) >= REMEMBERED_SETS:
                self._sets.clear()
            found = self._sets[numbers] = tuple(self._series[number] for number in numbers)
        return found
