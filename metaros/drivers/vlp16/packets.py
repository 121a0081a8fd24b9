"""A VLP-16's data packets to points, by numpy: many packets at once (VLP-16 User Manual, 63-9243).

1206 bytes: 12 blocks of 100, each 0xFFEE, azimuth u16 in 0.01 deg, 32 × (distance u16 in 2 mm, reflectivity u8): two
firings of 16 lasers; then u32 µs past the hour of the first firing, the return mode, the product (0x22). A firing takes
55.296 µs, a laser in it 2.304 µs; a block's azimuth is that of its first laser, the others' lie between it and the next
block's. In dual mode blocks come in pairs of the same firings: the last return, then the strongest (the second
strongest where they are the same).

Azimuths are clockwise from the connector's opposite side (ahead); x is ahead, y left, z up.
"""

from __future__ import annotations

import struct
from typing import Final

import numpy as np
import numpy.typing as npt

__all__ = [
    "BLOCKS",
    "BLOCK_US",
    "DUAL",
    "ELEVATIONS_DEG",
    "PACKET_BYTES",
    "PACKET_DTYPE",
    "POINT_DTYPE",
    "RETURN_MODES",
    "packet_problem",
    "packet_us",
    "points_of",
]

PACKET_BYTES: Final = 1206
BLOCKS: Final = 12
DUAL: Final = 0x39
RETURN_MODES: Final = {0x37: "strongest", 0x38: "last", DUAL: "dual"}
PRODUCT: Final = 0x22
FIRING_US: Final = 55.296
LASER_US: Final = 2.304
BLOCK_US: Final = 2 * FIRING_US
ELEVATIONS_DEG: Final = (-15, 1, -13, 3, -11, 5, -9, 7, -7, 9, -5, 11, -3, 13, -1, 15)  # by laser
_HEIGHTS_MM: Final = (11.2, -0.7, 9.7, -2.2, 8.1, -3.7, 6.6, -5.1, 5.1, -6.6, 3.7, -8.1, 2.2, -9.7, 0.7, -11.2)
_DISTANCE_M: Final = 0.002
_FULL: Final = 36_000  # a turn in 0.01 deg
_MOST_GAP: Final = 300  # 0.01 deg between blocks; 20 turns a second have 80

_RETURN: Final = [("distance", "<u2"), ("reflectivity", "u1")]
PACKET_DTYPE: Final = np.dtype(
    [
        ("blocks", [("flag", "<u2"), ("azimuth", "<u2"), ("returns", _RETURN, 32)], BLOCKS),
        ("us", "<u4"),
        ("mode", "u1"),
        ("product", "u1"),
    ]
)
POINT_DTYPE: Final = np.dtype(
    {
        "names": ["x", "y", "z", "intensity", "ring", "time"],
        "formats": ["<f4", "<f4", "<f4", "<f4", "<u2", "<f4"],
        "offsets": [0, 4, 8, 12, 16, 18],
        "itemsize": 22,
    }
)

_LASERS: Final = np.tile(np.arange(16), 2)  # of a block's 32 returns
_ELEVATION: Final = np.radians(np.array(ELEVATIONS_DEG, np.float64))[_LASERS]
_COS_E: Final = (np.cos(_ELEVATION) * _DISTANCE_M).astype(np.float32)
_SIN_E: Final = (np.sin(_ELEVATION) * _DISTANCE_M).astype(np.float32)
_HEIGHT: Final = (np.array(_HEIGHTS_MM) / 1000).astype(np.float32)[_LASERS]
_RING: Final = np.argsort(np.argsort(ELEVATIONS_DEG)).astype(np.uint16)[_LASERS]  # from the lowest on
_WITHIN_US: Final = np.repeat([0.0, FIRING_US], 16) + _LASERS * LASER_US  # since the block began
_PART: Final = (_WITHIN_US / BLOCK_US).astype(np.float32)
_TURN: Final = np.radians(np.arange(_FULL) / 100)
_COS: Final = np.cos(_TURN).astype(np.float32)
_SIN: Final = np.sin(_TURN).astype(np.float32)

Packets = npt.NDArray[np.void]
Points = npt.NDArray[np.void]


def packet_problem(data: bytes | memoryview) -> str:
    """Why these bytes are no data packet of a VLP-16, as a counter's name; "" for one that is."""
    if len(data) != PACKET_BYTES:
        return "wrong_size"
    if any(data[at] != 0xFF or data[at + 1] != 0xEE for at in range(0, 1200, 100)):
        return "wrong_magic"
    if data[1205] != PRODUCT or data[1204] not in RETURN_MODES:
        return "wrong_product"
    return ""


def packet_us(data: bytes | memoryview) -> int:
    """When its first firing was, in µs past the hour by the device's clock."""
    (us,) = struct.unpack_from("<I", data, 1200)
    return int(us)


def points_of(
    azimuths: npt.NDArray[np.int64],
    returns: npt.NDArray[np.void],
    *,
    begun_us: npt.NDArray[np.float32],
    dual: bool,
) -> Points:
    """The points of n blocks, in the packets' order; rays without a return are left out.

    `azimuths` (n,), `returns` (n, 32), `begun_us` (n,) when each block began, from which the points' `time` (s) counts.
    """
    distances = returns["distance"]
    there = distances > 0
    if dual:
        there[1::2] &= ~_same(returns)
    step = 2 if dual else 1
    precise = azimuths[:, None] + _PART * _gaps(azimuths, step)[:, None]
    index = np.rint(precise).astype(np.intp) % _FULL
    chosen = np.nonzero(there)
    lasers, at, ranges = chosen[1], index[chosen], distances[chosen].astype(np.float32)
    flat = ranges * _COS_E[lasers]
    points = np.empty(len(at), POINT_DTYPE)
    points["x"] = flat * _COS[at]
    points["y"] = -flat * _SIN[at]
    points["z"] = ranges * _SIN_E[lasers] + _HEIGHT[lasers]
    points["intensity"] = returns["reflectivity"][chosen]
    points["ring"] = _RING[lasers]
    points["time"] = (begun_us[chosen[0]] + _WITHIN_US[lasers].astype(np.float32)) * np.float32(1e-6)
    return points


def _same(returns: npt.NDArray[np.void]) -> npt.NDArray[np.bool_]:
    """In dual mode, where the second block of a pair tells what the first has told."""
    first, second = returns[0::2], returns[1::2]
    same: npt.NDArray[np.bool_] = first["distance"][: len(second)] == second["distance"]
    return same


def _gaps(azimuths: npt.NDArray[np.int64], step: int) -> npt.NDArray[np.float32]:
    """How far the head turns in each block; of the last, and where packets are missing, as far as in the others."""
    gaps = np.zeros(len(azimuths), np.float32)
    if len(azimuths) > step:
        between = (azimuths[step:] - azimuths[:-step]) % _FULL
        usual = np.median(between[between <= _MOST_GAP]) if (between <= _MOST_GAP).any() else 0
        gaps[:-step] = np.where(between <= _MOST_GAP, between, usual)
        gaps[-step:] = usual
    return gaps
