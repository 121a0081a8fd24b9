"""The polling schedule: which requests read the points, and when. Few, and none late behind another. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from metaros.drivers.modbus.points import Point
from metaros.drivers.modbus.protocol import Request, read_request

__all__ = ["Group", "PollingPlan"]

MOST_REGISTERS: Final = 125
MOST_BITS: Final = 2000


@dataclass(slots=True)
class Group:
    """Neighbours that one request reads."""

    points: tuple[Point, ...]
    due_s: float = 0.0

    @property
    def request(self) -> Request:
        """What reads them all."""
        return read_request(self.points[0].table, self._start, self._end - self._start)

    def raw(self, point: Point, values: Sequence[int]) -> Sequence[int]:
        """A point's part of the answer."""
        first = point.address - self._start
        return values[first : first + point.count]

    @property
    def _start(self) -> int:
        return self.points[0].address

    @property
    def _end(self) -> int:
        return max(point.address + point.count for point in self.points)


class PollingPlan:
    """Points of one table and period are read together where they touch; between them nothing is read that nobody
    asked for, since a device may refuse it.
    """

    def __init__(self, points: Sequence[Point]) -> None:
        self.groups: list[Group] = []
        end = most = 0
        for point in sorted(points, key=lambda one: (one.table, one.period_s, one.address)):
            last = self.groups[-1].points if self.groups else ()
            same = last and (last[0].table, last[0].period_s) == (point.table, point.period_s)
            if same and point.address <= end and point.address + point.count - last[0].address <= most:
                self.groups[-1].points += (point,)
                end = max(end, point.address + point.count)
            else:
                self.groups.append(Group((point,)))
                end, most = point.address + point.count, MOST_BITS if point.is_bit else MOST_REGISTERS

    def due(self, now_s: float) -> Iterator[Group]:
        """The groups whose time has come, the longest due first; what was missed is not made up for."""
        for group in sorted((one for one in self.groups if one.due_s <= now_s), key=lambda one: one.due_s):
            period_s = group.points[0].period_s
            group.due_s = group.due_s + period_s if group.due_s + period_s > now_s else now_s + period_s
            yield group

    def wait_s(self, now_s: float) -> float:
        """How long until one is due."""
        return max(0.0, min(group.due_s for group in self.groups) - now_s)

    def split(self, group: Group) -> None:
        """The device refuses to give them together: ask for each alone."""
        self.groups.remove(group)
        self.groups += [Group((point,), group.due_s) for point in group.points]
