"""The one world of `metaros sim`: racks in two blocks, aisles between them, pallets along the walls, and its streets.

Five aisles run west to east and three cross aisles south to north; their crossings are the nodes of the route graph.
Robots keep right, so two of them pass each other in an aisle.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

from metaros.sim.world import Box, World

__all__ = ["AISLES_Y", "CROSSINGS", "CROSS_AISLES_X", "NEIGHBOURS", "WAREHOUSE", "start_places"]

AISLES_Y = (1.8, 5.4, 9.0, 12.6, 16.2)
CROSS_AISLES_X = (2.1, 14.0, 25.9)
_RACK_BLOCKS_X = (4.2, 15.7)  # where the western and the eastern block begin
_RACKS = 3  # of each row and block
_RACK_M = 2.6
_RACK_GAP_M = 0.15
_RACK_DEPTH_M = 1.2


def _racks() -> Iterator[Box]:
    for south, north in pairwise(AISLES_Y):
        y_min = (south + north - _RACK_DEPTH_M) / 2
        for begin in _RACK_BLOCKS_X:
            for place in range(_RACKS):
                x_min = begin + place * (_RACK_M + _RACK_GAP_M)
                yield Box("rack", x_min, y_min, x_min + _RACK_M, y_min + _RACK_DEPTH_M, 2.3)


WAREHOUSE = World(
    (
        Box("room", 0.0, 0.0, 28.0, 18.0, 4.2),
        *_racks(),
        Box("pillar", 0.0, 8.7, 0.4, 9.3, 4.2),
        Box("pillar", 27.6, 8.7, 28.0, 9.3, 4.2),
        Box("pillar", 13.8, 0.0, 14.2, 0.4, 4.2),
        Box("pillar", 13.8, 17.6, 14.2, 18.0, 4.2),
        Box("pallet", 5.0, 0.05, 6.2, 0.75, 0.95),
        Box("pallet", 6.5, 0.05, 7.7, 0.75, 1.25),
        Box("pallet", 10.2, 0.05, 11.4, 0.75, 0.95),
        Box("pallet", 17.0, 0.05, 18.2, 0.75, 1.25),
        Box("pallet", 21.6, 0.05, 22.8, 0.75, 0.95),
        Box("pallet", 8.0, 17.25, 9.2, 17.95, 1.25),
        Box("pallet", 16.3, 17.25, 17.5, 17.95, 0.95),
        Box("pallet", 19.0, 17.25, 20.2, 17.95, 0.95),
        Box("pallet", 0.05, 3.2, 0.75, 4.4, 0.95),
        Box("pallet", 0.05, 13.6, 0.75, 14.8, 1.25),
        Box("pallet", 27.25, 3.4, 27.95, 4.6, 1.25),
        Box("cabinet", 27.4, 12.9, 28.0, 14.9, 1.9),
        Box("cabinet", 0.0, 6.0, 0.6, 7.6, 1.9),
    )
)

CROSSINGS: tuple[tuple[float, float], ...] = tuple((x, y) for y in AISLES_Y for x in CROSS_AISLES_X)


def _neighbours() -> tuple[tuple[int, ...], ...]:
    columns, rows = len(CROSS_AISLES_X), len(AISLES_Y)
    table: list[tuple[int, ...]] = []
    for node in range(columns * rows):
        row, column = divmod(node, columns)
        around = ((row, column - 1), (row, column + 1), (row - 1, column), (row + 1, column))
        table.append(tuple(r * columns + c for r, c in around if 0 <= r < rows and 0 <= c < columns))
    return tuple(table)


NEIGHBOURS = _neighbours()


def start_places() -> list[tuple[float, float]]:
    """Places to start from, far apart: the crossings, then every 1.6 m of the aisles."""
    places = list(CROSSINGS)
    for x in (4.6 + 1.6 * step for step in range(13)):
        places.extend((x, y) for y in AISLES_Y if min(abs(x - crossing) for crossing in CROSS_AISLES_X) > 1.2)
    return places
