"""What an LD19 in a room sends, byte for byte: 375 packets a second at ten turns a second."""

from __future__ import annotations

from metaros.drivers.ld19.protocol import CLOCK_MS, POINTS, Packet, pack
from tests.support.devices.room import distance_m

__all__ = ["Ld19Emulator"]

POINTS_A_S = 4500


class Ld19Emulator:
    """Packets one after the other; `speed_hz` turns a second."""

    def __init__(self, *, speed_hz: float = 10.0) -> None:
        self.step_deg = 360 * speed_hz / POINTS_A_S
        self.angle_deg = 0.0
        self.points = 0
        self.speed_deg_s = round(speed_hz * 360)

    def packet(self) -> bytes:
        """The next one."""
        angles = [(self.angle_deg + index * self.step_deg) % 360 for index in range(POINTS)]
        made = Packet(
            speed_deg_s=self.speed_deg_s,
            first_deg=angles[0],
            last_deg=angles[-1],
            distances_mm=tuple(round(1000 * distance_m(angle)) for angle in angles),
            intensities=tuple(200 + index for index in range(POINTS)),
            clock_ms=int(self.points / POINTS_A_S * 1000) % CLOCK_MS,
        )
        self.angle_deg = (self.angle_deg + POINTS * self.step_deg) % 360
        self.points += POINTS
        return pack(made)

    def turns(self, count: float) -> bytes:
        """So many turns."""
        return b"".join(self.packet() for _ in range(round(count * 360 / self.step_deg / POINTS)))
