"""Pictures of the warehouse's surfaces, painted once at the start: racks with goods, walls, pallets, floor, ceiling.

Painted with numpy alone from a fixed seed, as 0..255 BGR; all faces live side by side in one atlas, in which a surface
is a strip of columns. Every strip exists twice, sharp and blurred, for near and far.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from metaros.sim.warehouse import AISLES_Y, CROSS_AISLES_X
from metaros.sim.world import World

__all__ = [
    "ATLAS_ROWS",
    "FLOOR_PX_PER_M",
    "PX_PER_M",
    "ROBOT_HEIGHT_M",
    "Atlas",
    "Strip",
    "ceiling",
    "floor",
    "pack",
    "paint_atlas",
]

Picture = npt.NDArray[np.uint8]
PX_PER_M = 48
ATLAS_ROWS = 256
FLOOR_PX_PER_M = 20
_BROWNS = ((92, 142, 187), (80, 128, 172), (104, 156, 200), (70, 112, 150))
_CARTONS = (*_BROWNS, (176, 120, 60), (60, 140, 70), (52, 70, 170))
_HULLS = ((214, 148, 52), (80, 176, 70), (60, 90, 220), (190, 80, 170), (40, 180, 220), (160, 160, 60))
ROBOT_HEIGHT_M = 0.52


@dataclass(frozen=True, slots=True)
class Strip:
    """Where a surface lies in the atlas: first column of its sharp and its blurred copy, columns, height in metres."""

    sharp: int
    blurred: int
    columns: int
    height_m: float


@dataclass(frozen=True, slots=True)
class Atlas:
    """All surfaces in one picture of packed BGRX pixels, `ATLAS_ROWS` high; row 0 is a surface's upper edge."""

    pixels: npt.NDArray[np.uint32]
    strips: dict[str, tuple[Strip, ...]]

    def strip(self, kind: str, number: int) -> Strip:
        """The surface of the `number`-th thing of a kind; kinds with several take turns."""
        strips = self.strips[kind]
        return strips[number % len(strips)]


def _grain(rng: np.random.Generator, picture: Picture, strength: float) -> Picture:
    noise = rng.normal(0.0, strength, picture.shape[:2])[..., None]
    return np.clip(picture + noise, 0, 255).astype(np.uint8)


def _rack(rng: np.random.Generator) -> Picture:
    """Blue uprights, orange beams, three levels of cartons, seen from an aisle."""
    rows, columns = ATLAS_ROWS, round(2.6 * PX_PER_M)
    picture = np.full((rows, columns, 3), (38, 34, 32), dtype=np.uint8)
    level = rows // 3
    for shelf in range(3):
        bottom = (shelf + 1) * level - 8
        column = 6
        while column < columns - 14:
            width, height = int(rng.integers(14, 34)), int(rng.integers(level // 3, level - 14))
            right = min(column + width, columns - 6)
            colour = np.array(_CARTONS[int(rng.integers(len(_CARTONS)))]) * rng.uniform(0.8, 1.1)
            picture[bottom - height : bottom, column:right] = np.clip(colour, 0, 255)
            picture[bottom - height : bottom, right - 1 : right] = colour * 0.55
            picture[bottom - height : bottom - height + 2, column:right] = np.clip(colour * 1.2, 0, 255)
            middle = (column + right) // 2
            picture[bottom - height : bottom, middle : middle + 2] = np.clip(colour * 0.85, 0, 255)
            if width > 20:
                picture[bottom - height // 2 : bottom - height // 2 + 6, column + 4 : column + 11] = (225, 228, 230)
            column = right + int(rng.integers(1, 5))
        picture[bottom : bottom + 8] = (34, 104, 226)
        picture[bottom + 6 : bottom + 8] = (20, 66, 150)
    picture[:, :6] = picture[:, -6:] = (150, 84, 30)
    picture[:, 5:6] = picture[:, -6:-5] = (84, 46, 18)
    return _grain(rng, picture, 5.0)


def _wall(rng: np.random.Generator) -> Picture:
    """Twelve metres of light panels with a dark base, a blue band and a gate."""
    columns = 12 * PX_PER_M
    picture = np.full((ATLAS_ROWS, columns, 3), (196, 202, 204), dtype=np.uint8)
    picture[:, :: PX_PER_M // 2] = (168, 174, 177)
    picture[ATLAS_ROWS * 2 // 5 : ATLAS_ROWS * 2 // 5 + 12] = (158, 104, 44)
    picture[-22:] = (92, 96, 98)
    gate = picture[ATLAS_ROWS // 4 : -4, 240:384]
    gate[:] = (122, 128, 134)
    gate[::9] = (98, 104, 110)
    gate[:, :4] = gate[:, -4:] = (30, 190, 235)
    return _grain(rng, picture, 3.0)


def _pallet(rng: np.random.Generator) -> Picture:
    """Wrapped cartons on wood."""
    columns = round(1.2 * PX_PER_M)
    picture = np.full((ATLAS_ROWS, columns, 3), (110, 152, 190), dtype=np.uint8)
    for row in range(0, ATLAS_ROWS - 40, 52):
        picture[row : row + 3] = (66, 96, 126)
    picture[:, :: columns // 3] = (72, 104, 134)
    picture[30:70, columns // 2 : columns // 2 + 14] = (228, 230, 232)
    picture[-38:] = (70, 108, 148)
    picture[-26:-8, 6 : columns // 2 - 3] = picture[-26:-8, columns // 2 + 3 : -6] = (24, 26, 30)
    return _grain(rng, picture, 7.0)


def _plain(rng: np.random.Generator, colour: tuple[int, int, int], *, stripes: bool) -> Picture:
    """A pillar (with a warning pattern at its foot) or a cabinet."""
    picture = np.full((ATLAS_ROWS, PX_PER_M, 3), colour, dtype=np.uint8)
    if stripes:
        rows, columns = np.mgrid[0:64, 0:PX_PER_M]
        band = ((rows + columns) // 12) % 2 == 0
        picture[-64:] = np.where(band[..., None], (20, 200, 240), (24, 24, 26))
    else:
        picture[:, PX_PER_M // 2 - 1 : PX_PER_M // 2 + 1] = np.array(colour) * 0.6
        picture[40:60, 8:40] = (40, 200, 250)
    return _grain(rng, picture, 4.0)


def _robot(rng: np.random.Generator, colour: tuple[int, int, int]) -> npt.NDArray[np.uint32]:
    """A round hull: skirt, coloured body with a light strip, and a laser turret that is narrower than the body."""
    columns = 64
    picture = np.full((ATLAS_ROWS, columns, 3), colour, dtype=np.uint8)
    picture[:58] = (40, 40, 44)
    picture[18:34] = (28, 30, 120)
    picture[58:66] = np.array(colour) * 0.6
    picture[128:142] = (250, 246, 226)
    picture[206:] = (44, 44, 48)
    picture[150:196, 26:38] = (36, 38, 42)
    curve = 0.55 + 0.45 * np.sin(np.linspace(0.12, np.pi - 0.12, columns))
    words = pack(_grain(rng, (picture * curve[None, :, None]).astype(np.uint8), 2.0))
    words[:58, :22] = words[:58, -22:] = 0
    return words


def _blurred(picture: Picture) -> Picture:
    """Averaged over 8 x 8 pixels, so that far surfaces do not flicker."""
    rows, columns = picture.shape[:2]
    small = picture.reshape(rows // 8, 8, columns // 8, 8, 3).mean(axis=(1, 3))
    blurred: Picture = small.repeat(8, axis=0).repeat(8, axis=1).astype(np.uint8)
    return blurred


def paint_atlas(world: World) -> Atlas:
    """Paint every kind of box in `world`."""
    rng = np.random.default_rng(7)
    painted: dict[str, list[Picture]] = {
        "rack": [_rack(rng) for _ in range(6)],
        "room": [_wall(rng)],
        "pallet": [_pallet(rng) for _ in range(2)],
        "pillar": [_plain(rng, (170, 176, 178), stripes=True)],
        "cabinet": [_plain(rng, (120, 96, 70), stripes=False)],
    }
    columns: list[npt.NDArray[np.uint32]] = []
    strips: dict[str, tuple[Strip, ...]] = {}
    place = 0
    heights = {box.kind: box.height_m for box in world.boxes}
    for kind, pictures in painted.items():
        made = []
        for picture in pictures:
            width = picture.shape[1] // 8 * 8
            sharp = picture[:, :width]
            made.append(Strip(place, place + width, width, heights.get(kind, 1.0)))
            columns += [pack(sharp), pack(_blurred(sharp))]
            place += 2 * width
        strips[kind] = tuple(made)
    hulls = [_robot(rng, colour) for colour in _HULLS]
    strips["robot"] = tuple(
        Strip(place + 64 * index, place + 64 * index, 64, ROBOT_HEIGHT_M) for index in range(len(hulls))
    )
    return Atlas(np.concatenate((*columns, *hulls), axis=1), strips)


def pack(picture: Picture) -> npt.NDArray[np.uint32]:
    """BGR bytes as one 32-bit word a pixel, so that one gather moves a pixel; the word 0 is see-through."""
    four = np.full((*picture.shape[:2], 4), 255, dtype=np.uint8)
    four[..., :3] = picture
    return four.view(np.uint32)[..., 0]


def floor(world: World) -> npt.NDArray[np.uint32]:
    """Concrete slabs, yellow lines along the aisles, zebra crossings; packed, row 0 at the south wall."""
    rng = np.random.default_rng(8)
    scale = FLOOR_PX_PER_M
    rows, columns = round(world.room.y_max * scale), round(world.room.x_max * scale)
    picture = np.full((rows, columns, 3), (128, 132, 134), dtype=np.float64)
    patches = rng.normal(0.0, 9.0, (rows // 20 + 1, columns // 20 + 1))
    picture += patches.repeat(20, 0).repeat(20, 1)[:rows, :columns, None]
    picture[:: 4 * scale] -= 30.0
    picture[:, :: 4 * scale] -= 30.0
    yellow = (40.0, 190.0, 235.0)
    for y in AISLES_Y:
        for side in (-1.05, 1.05):
            row = round((y + side) * scale)
            picture[row - 1 : row + 2] = yellow
    for x in CROSS_AISLES_X:
        for y in AISLES_Y:
            middle = picture[round((y - 1.1) * scale) : round((y + 1.1) * scale)]
            for bar in range(-4, 5):
                at = round((x + bar * 0.4) * scale)
                middle[:, at - 2 : at + 3] = (214.0, 218.0, 220.0)
    return pack(_grain(rng, np.clip(picture, 0, 255).astype(np.uint8), 4.0))


def ceiling(world: World) -> npt.NDArray[np.uint32]:
    """Dark trusses and a row of lamps over every aisle; packed."""
    scale = FLOOR_PX_PER_M
    rows, columns = round(world.room.y_max * scale), round(world.room.x_max * scale)
    picture = np.full((rows, columns, 3), (84, 80, 76), dtype=np.uint8)
    picture[:, :: 2 * scale] = (58, 54, 50)
    picture[:, 1 :: 2 * scale] = (58, 54, 50)
    for y in AISLES_Y:
        row = round(y * scale)
        for column in range(scale, columns - 2 * scale, 3 * scale):
            picture[row - 3 : row + 3, column : column + 2 * scale] = (250, 252, 252)
    return pack(picture)
