"""Columns for a drawing that flows from left to right: which box is in which, and in what order. Pure.

The steps are Sugiyama's: an order in which few arcs point backwards, the longest path for the column, then sweeps that
sort each column by where its neighbours are, and last a place for each box as near to its neighbours as others let it.
"""

from __future__ import annotations

from bisect import bisect_right, insort
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

__all__ = ["Cell", "columns_of", "place", "sort_columns"]

Arc = tuple[str, str]
Neighbours = Mapping[str, Sequence[str]]
SWEEPS = 8
SETTLE = 12  # rounds in which boxes move towards their neighbours


@dataclass(eq=False, slots=True)
class Cell:
    """A box in a column, or a bend where a long arc passes one."""

    key: str
    lane: int
    column: int
    height: float
    y: float = 0.0  # its middle, from the top of its lane
    before: list[Cell] = field(default_factory=list)
    after: list[Cell] = field(default_factory=list)


def columns_of(keys: Sequence[str], arcs: Iterable[Arc]) -> dict[str, int]:
    """Each key's column, from 0: all arcs lead forwards, but for those that close circles.

    Where the arcs get shorter so, everything comes as early as the arc from its first writer lets it, and others lead
    back. Arcs join boxes of two sorts (nodes and what links them), so that never both ends are in one column.
    """
    arcs = [arc for arc in arcs if arc[0] != arc[1]]
    turn = {key: number for number, key in enumerate(_forward(keys, arcs))}
    ahead: dict[str, list[str]] = {key: [] for key in keys}
    behind: dict[str, list[str]] = {key: [] for key in keys}
    for tail, head in arcs:
        first, second = (tail, head) if turn[tail] < turn[head] else (head, tail)
        ahead[first].append(second)
        behind[second].append(first)
    order = sorted(keys, key=turn.__getitem__)
    choices = [_latest(order, ahead, behind), _earliest(order, ahead, behind)]
    for column in choices:
        for key in reversed(order):  # what only sends stands right before who reads it first
            if ahead[key] and not behind[key]:
                column[key] = min(column[other] for other in ahead[key]) - 1
    column = min(choices, key=lambda column: sum(abs(column[head] - column[tail]) for tail, head in arcs))
    least = min(column.values(), default=0)
    return {key: number - least for key, number in column.items()}


def _latest(order: Sequence[str], ahead: Neighbours, behind: Neighbours) -> dict[str, int]:
    """After everything that leads to it: the longest path."""
    column: dict[str, int] = {}
    for key in order:
        column[key] = max((column[other] + 1 for other in behind[key]), default=0)
    return column


def _earliest(order: Sequence[str], ahead: Neighbours, behind: Neighbours) -> dict[str, int]:
    """After the first thing that leads to it: the shortest path, from starts of both sorts."""
    column: dict[str, int] = {}
    sort: dict[str, int] = {}
    for start in order:  # by sorts, so that one's starts are in even columns, the other's in odd ones
        todo = [start] if start not in sort else []
        sort.setdefault(start, 0)
        while todo:
            key = todo.pop()
            for other in (*ahead[key], *behind[key]):
                if other not in sort:
                    sort[other] = 1 - sort[key]
                    todo.append(other)
    for key in order:
        column[key] = min((column[other] + 1 for other in behind[key]), default=sort[key])
    return column


def _forward(keys: Sequence[str], arcs: Sequence[Arc]) -> list[str]:
    """The greedy order of Eades, Lin and Smyth: readers to the end, writers to the front, then who writes most."""
    heads: dict[str, set[str]] = {key: set() for key in keys}
    tails: dict[str, set[str]] = {key: set() for key in keys}
    for tail, head in arcs:
        heads[tail].add(head)
        tails[head].add(tail)
    left = dict.fromkeys(sorted(keys))
    front: list[str] = []
    back: list[str] = []

    def take(key: str, where: list[str]) -> None:
        where.append(key)
        del left[key]
        for other in heads[key]:
            tails[other].discard(key)
        for other in tails[key]:
            heads[other].discard(key)

    while left:
        ends = [key for key in left if not heads[key]]
        starts = [key for key in left if not tails[key] and heads[key]]
        for key in ends:
            take(key, back)
        for key in starts:
            take(key, front)
        if not ends and not starts:
            take(max(left, key=lambda key: len(heads[key]) - len(tails[key])), front)
    return front + back[::-1]


def sort_columns(columns: Sequence[list[Cell]]) -> None:
    """Order each column, lane by lane, so that few arcs cross; the best order that the sweeps find stays."""
    for column in columns:
        column.sort(key=lambda cell: (cell.lane, cell.key))
    best, least = [list(column) for column in columns], _crossings(columns)
    for sweep in range(SWEEPS):
        forward = sweep % 2 == 0
        where = _positions(columns)
        for column in columns if forward else reversed(columns):
            near: Callable[[Cell], list[Cell]] = (lambda c: c.before) if forward else (lambda c: c.after)
            wanted = {cell.key: _mean(where[other.key] for other in near(cell)) for cell in column}
            column.sort(key=lambda cell: (cell.lane, _or(wanted[cell.key], where[cell.key])))
            where.update(_positions([column]))
        if (found := _crossings(columns)) < least:
            best, least = [list(column) for column in columns], found
    for column, order in zip(columns, best, strict=True):
        column[:] = order


def _positions(columns: Iterable[list[Cell]]) -> dict[str, float]:
    """Where each cell is: the number of its lane, and how far down in it."""
    found = {}
    for column in columns:
        by_lane: dict[int, list[Cell]] = {}
        for cell in column:
            by_lane.setdefault(cell.lane, []).append(cell)
        for lane, cells in by_lane.items():
            found.update({cell.key: lane + (n + 0.5) / len(cells) for n, cell in enumerate(cells)})
    return found


def _crossings(columns: Sequence[list[Cell]]) -> int:
    """How many pairs of arcs cross between neighbouring columns."""
    total = 0
    for left, right in pairwise(columns):
        row = {cell.key: number for number, cell in enumerate(right)}
        seen: list[int] = []
        for cell in left:
            ends = sorted(row[other.key] for other in cell.after)
            total += sum(len(seen) - bisect_right(seen, end) for end in ends)
            for end in ends:
                insort(seen, end)
    return total


def place(columns: Sequence[list[Cell]], *, gap: float) -> None:
    """Give every cell of one lane its `y`: near its neighbours in the lane, in the column's order, `gap` apart."""
    for column in columns:
        _spread(column, {}, gap)
    for number in range(SETTLE):
        for column in columns if number % 2 == 0 else reversed(columns):
            wanted = {}
            for cell in column:
                near = [other.y for other in (*cell.before, *cell.after) if other.lane == cell.lane]
                wanted[cell.key] = _or(_mean(near), cell.y)
            _spread(column, wanted, gap)
    top = min((cell.y - cell.height / 2 for column in columns for cell in column), default=0.0)
    for column in columns:
        for cell in column:
            cell.y = round(cell.y - top, 1)


def _spread(column: Sequence[Cell], wanted: Mapping[str, float], gap: float) -> None:
    """The places nearest to the wanted ones (least squares) at which nothing overlaps: neighbours that collide move as
    one block to the mean of what they want."""
    offsets, offset = [], 0.0
    blocks: list[list[float]] = []  # sum of wishes, number of cells
    for cell in column:
        offset += cell.height / 2
        offsets.append(offset)
        blocks.append([wanted.get(cell.key, 0.0) - offset, 1])
        offset += cell.height / 2 + gap
        while len(blocks) > 1 and blocks[-2][0] / blocks[-2][1] > blocks[-1][0] / blocks[-1][1]:
            wish, count = blocks.pop()
            blocks[-1][0] += wish
            blocks[-1][1] += count
    starts = [wish / count for wish, count in blocks for _ in range(int(count))]
    for cell, start, offset in zip(column, starts, offsets, strict=True):
        cell.y = start + offset


def _mean(values: Iterable[float]) -> float | None:
    found = list(values)
    return sum(found) / len(found) if found else None


def _or(value: float | None, other: float) -> float:
    return other if value is None else value
