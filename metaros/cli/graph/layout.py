"""Where the boxes and arcs of a drawing go: unlinked parts beside each other, in each part columns from left to right,
and every group (a namespace) in a lane of its own, so that its frame holds nothing foreign. Pure.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

from metaros.cli.graph.layers import Arc, Cell, columns_of, place, sort_columns

__all__ = ["Box", "Plan", "Rect", "lay_out"]

GAP = 10.0  # between boxes of a column
CHANNEL = 64.0  # between columns: here the arcs turn
FRAME, HEADING = 14.0, 26.0  # a group's frame around its boxes, and the line with its name
PART_GAP = 28.0
BEND = 6.0  # what a passing arc takes of a column
PORT_STEP = 7.0  # between the ends of arcs at a box
ASPECT = 1.6


@dataclass(frozen=True, slots=True)
class Box:
    """Something to be placed; an empty group is none."""

    width: float
    height: float
    group: str = ""


@dataclass(frozen=True, slots=True)
class Rect:
    """A place."""

    x: float
    y: float
    width: float
    height: float

    def moved(self, dx: float, dy: float) -> Rect:
        """The same, elsewhere."""
        return replace(self, x=self.x + dx, y=self.y + dy)


Route = tuple[tuple[float, float], ...]


@dataclass(slots=True)
class Plan:
    """The whole drawing: places of boxes and groups, and for each arc the points through which it goes.

    A route's points come in pairs that are level: from the edge of a column to the next one's it turns.
    """

    width: float = 0.0
    height: float = 0.0
    boxes: dict[str, Rect] = field(default_factory=dict)
    groups: dict[str, Rect] = field(default_factory=dict)
    routes: dict[Arc, Route] = field(default_factory=dict)


def lay_out(boxes: Mapping[str, Box], arcs: Iterable[Arc], *, aspect: float = ASPECT) -> Plan:
    """Place everything; the sheet is about `aspect` times as wide as high where the parts allow."""
    arcs = sorted(set(arcs))
    sheets = [_sheet({key: boxes[key] for key in part}, arcs) for part in _parts(boxes, arcs)]
    plans = (_pack(sheets, count) for count in range(1, len(sheets) + 1))
    return min(plans, key=lambda plan: abs(plan.width / max(plan.height, 1.0) - aspect), default=Plan())


def _parts(boxes: Mapping[str, Box], arcs: Iterable[Arc]) -> list[list[str]]:
    """What is linked by arcs or a group stays together; in the order of names."""
    root = {key: key for key in boxes}

    def find(key: str) -> str:
        while root[key] != key:
            root[key] = key = root[root[key]]
        return key

    first: dict[str, str] = {}
    for key, box in sorted(boxes.items()):
        if box.group:
            root[find(key)] = find(first.setdefault(box.group, key))
    for tail, head in arcs:
        root[find(tail)] = find(head)
    parts: dict[str, list[str]] = {}
    for key in sorted(boxes, key=lambda key: (boxes[key].group or key, key)):
        parts.setdefault(find(key), []).append(key)
    return sorted(parts.values(), key=lambda part: len(part) == 1)  # who is alone comes last


def _sheet(boxes: Mapping[str, Box], arcs: Sequence[Arc]) -> Plan:
    """One part, its upper left corner at 0, 0."""
    own = [arc for arc in arcs if arc[0] in boxes]
    column_of = columns_of(list(boxes), own)
    lanes = _lanes(boxes, own)
    cells = {key: Cell(key, lanes.index(box.group), column_of[key], box.height) for key, box in boxes.items()}
    chains = _chains(cells, own)
    columns: list[list[Cell]] = [[] for _ in range(max(column_of.values()) + 1)]
    for cell in {
        id(cell): cell for cell in (*cells.values(), *(c for chain in chains.values() for c in chain))
    }.values():
        columns[cell.column].append(cell)
    sort_columns(columns)
    plan = Plan()
    lefts = _widths(plan, columns, boxes)
    tops = _heights(plan, columns, lanes)
    for key, cell in cells.items():
        x, width = lefts[cell.column]
        plan.boxes[key] = Rect(x, tops[cell.lane] + cell.y - cell.height / 2, width, cell.height)
    _frames(plan, boxes, lanes)
    _routes(plan, chains, lefts, tops)
    return plan


def _lanes(boxes: Mapping[str, Box], arcs: Sequence[Arc]) -> list[str]:
    """Groups from top to bottom: neighbours are swapped while that shortens the arcs between them."""
    lanes = sorted({box.group for box in boxes.values()})
    pairs = [(boxes[a].group, boxes[b].group) for a, b in arcs if boxes[a].group != boxes[b].group]

    def length(order: Sequence[str]) -> int:
        row = {name: number for number, name in enumerate(order)}
        return sum(abs(row[a] - row[b]) for a, b in pairs)

    for _ in range(len(lanes)):
        before = length(lanes)
        for n in range(len(lanes) - 1):
            swapped = [*lanes[:n], lanes[n + 1], lanes[n], *lanes[n + 2 :]]
            if length(swapped) < length(lanes):
                lanes = swapped
        if length(lanes) == before:
            break
    return lanes


def _chains(cells: Mapping[str, Cell], arcs: Iterable[Arc]) -> dict[Arc, list[Cell]]:
    """The cells through which each arc goes, in its own direction, with a bend in every column that it passes."""
    chains = {}
    for tail, head in arcs:
        first, last = (
            (cells[tail], cells[head]) if cells[tail].column < cells[head].column else (cells[head], cells[tail])
        )
        chain = [first]
        for column in range(first.column + 1, last.column):
            lane = first.lane if column - first.column <= last.column - column else last.lane
            chain.append(Cell(f"{tail}\0{head}\0{column}", lane, column, BEND))
        chain.append(last)
        for one, other in pairwise(chain):
            one.after.append(other)
            other.before.append(one)
        chains[tail, head] = chain if first is cells[tail] else chain[::-1]
    return chains


def _widths(plan: Plan, columns: Sequence[Sequence[Cell]], boxes: Mapping[str, Box]) -> list[tuple[float, float]]:
    """Each column's left edge and width."""
    found, x = [], FRAME
    for column in columns:
        width = max((boxes[cell.key].width for cell in column if cell.key in boxes), default=0.0)
        found.append((x, width))
        x += width + CHANNEL + min(2.0 * sum(len(cell.after) for cell in column), CHANNEL)
    plan.width = found[-1][0] + found[-1][1] + FRAME
    return found


def _heights(plan: Plan, columns: Sequence[list[Cell]], lanes: Sequence[str]) -> list[float]:
    """Place the cells of each lane, and stack the lanes; where each one's first box begins."""
    tops, y = [], 0.0
    for number, name in enumerate(lanes):
        own = [[cell for cell in column if cell.lane == number] for column in columns]
        place(own, gap=GAP)
        bottom = max(cell.y + cell.height / 2 for column in own for cell in column)
        top = y + (HEADING + FRAME / 2 if name else FRAME)
        tops.append(top)
        y = top + bottom + FRAME + (GAP if number < len(lanes) - 1 else 0.0)
    plan.height = y
    return tops


def _frames(plan: Plan, boxes: Mapping[str, Box], lanes: Sequence[str]) -> None:
    for name in filter(None, lanes):
        own = [rect for key, rect in plan.boxes.items() if boxes[key].group == name]
        left, top = min(rect.x for rect in own), min(rect.y for rect in own)
        right, bottom = max(rect.x + rect.width for rect in own), max(rect.y + rect.height for rect in own)
        height = bottom - top + HEADING + FRAME * 1.5
        plan.groups[name] = Rect(left - FRAME, top - HEADING - FRAME / 2, right - left + 2 * FRAME, height)


def _routes(
    plan: Plan, chains: Mapping[Arc, list[Cell]], lefts: Sequence[tuple[float, float]], tops: Sequence[float]
) -> None:
    """From edge to edge of the columns; at each box the ends stand below each other, in the order of where they go."""
    spots: dict[tuple[str, str], float] = {}

    def middle(cell: Cell) -> float:
        return tops[cell.lane] + cell.y

    for cell in {id(cell): cell for chain in chains.values() for cell in (chain[0], chain[-1])}.values():
        for others in (cell.before, cell.after):
            step = min(PORT_STEP, (cell.height - 16.0) / max(len(others) - 1, 1))
            for number, other in enumerate(sorted(others, key=middle)):
                spots[cell.key, other.key] = middle(cell) + step * (number - (len(others) - 1) / 2)
    for arc, chain in chains.items():
        points: list[tuple[float, float]] = []
        for one, other in pairwise(chain):
            forward = one.column < other.column
            out = sum(lefts[one.column]) if forward else lefts[one.column][0]
            into = lefts[other.column][0] if forward else sum(lefts[other.column])
            points.append((out, spots.get((one.key, other.key), middle(one))))
            points.append((into, spots.get((other.key, one.key), middle(other))))
        plan.routes[arc] = tuple((round(x, 1), round(y, 1)) for x, y in points)


def _pack(sheets: Sequence[Plan], count: int) -> Plan:
    """All sheets in `count` stacks, each on the one that is least high."""
    stacks: list[list[tuple[float, Plan]]] = [[] for _ in range(count)]
    heights = [0.0] * count
    for sheet in sheets:
        n = heights.index(min(heights))
        stacks[n].append((heights[n], sheet))
        heights[n] += sheet.height + PART_GAP
    whole, x = Plan(height=max(heights) - PART_GAP), 0.0
    for stack in stacks:
        for y, sheet in stack:
            _add(whole, sheet, x, y)
        x += max((sheet.width for _, sheet in stack), default=0.0) + PART_GAP
    whole.width = x - PART_GAP
    return whole


def _add(whole: Plan, sheet: Plan, dx: float, dy: float) -> None:
    whole.boxes |= {key: rect.moved(dx, dy) for key, rect in sheet.boxes.items()}
    whole.groups |= {key: rect.moved(dx, dy) for key, rect in sheet.groups.items()}
    whole.routes |= {arc: tuple((x + dx, y + dy) for x, y in route) for arc, route in sheet.routes.items()}
