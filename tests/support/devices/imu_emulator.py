"""What serial IMUs send, byte for byte."""

from __future__ import annotations

import struct
from collections.abc import Sequence

G = 32768 / 16  # of WITMotion's acceleration
DEGREES_S = 32768 / 2000
DEGREES = 32768 / 180


def wit_frame(kind: int, words: Sequence[float]) -> bytes:
    """One frame of WITMotion's protocol: four int16, and the sum."""
    frame = struct.pack("<BB4h", 0x55, kind, *(max(-32768, min(32767, round(word))) for word in words))
    return frame + bytes((sum(frame) & 0xFF,))


def wit_round(
    *,
    acceleration_g: Sequence[float] = (0, 0, 1),
    rate_deg_s: Sequence[float] = (0, 0, 0),
    angles_deg: Sequence[float] | None = (0, 0, 90),
    magnetic_mg: Sequence[float] | None = (200, 0, -400),
    temperature_c: float = 25.5,
) -> bytes:
    """What one sample is made of: 51, 52, 53, 54; without what is None."""
    frames = wit_frame(0x51, [*(value * G for value in acceleration_g), temperature_c * 100])
    frames += wit_frame(0x52, [*(value * DEGREES_S for value in rate_deg_s), 0])
    if angles_deg is not None:
        frames += wit_frame(0x53, [*(value * DEGREES for value in angles_deg), 0])
    if magnetic_mg is not None:
        frames += wit_frame(0x54, [*magnetic_mg, 0])
    return frames
