"""Packets of a VLP-16 gathered into revolutions, cheaply: only their azimuths are looked at here."""

from __future__ import annotations

import struct
from collections import Counter
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from metaros.drivers.vlp16.packets import BLOCK_US, BLOCKS, DUAL, PACKET_DTYPE, packet_problem, packet_us, points_of

__all__ = ["MAX_PACKETS", "RawRevolution", "RevolutionSplitter", "decode"]

MAX_PACKETS: Final = 512  # of a turn: 5 turns a second in dual mode have 302
MIN_BLOCKS: Final = 24  # fewer are a stumble of the azimuth
_HOUR_US: Final = 3_600_000_000
_LOST_US: Final = 1_000_000  # a longer step of its clock is a restart, or its clock was set
_AZIMUTHS: Final = tuple(range(2, 1200, 100))
_DRIFT_NS: Final = 1000  # a packet: more than its clock drifts, so that an early arrival is forgotten some day


@dataclass(frozen=True, slots=True, kw_only=True)
class RawRevolution:
    """The packets of a revolution, of the first and last some blocks: blocks `first` to `last` of all of them.

    `us`: when each packet began, since the first one; `stamp_ns`: when the first block did, by this machine's clock.
    """

    packets: bytes
    us: tuple[int, ...]
    first: int
    last: int
    stamp_ns: int
    mode: int

    @property
    def dual(self) -> bool:
        """Whether blocks come in pairs of the same firings."""
        return self.mode == DUAL


class RevolutionSplitter:
    """Packets in, revolutions out, split where the azimuth passes `cut` (0.01 deg). The first, a part, is left out."""

    def __init__(self, *, cut: int = 18_000) -> None:
        self.counters: Counter[str] = Counter()
        self._cut = cut
        self._packets: list[bytes] = []
        self._stamps_us: list[int] = []
        self._first: int | None = None  # None until the first cut
        self._azimuth = -1
        self._us = -1
        self._mode = 0
        self._clock = DeviceClock()

    def add(self, data: bytes, arrived_ns: int) -> RawRevolution | None:
        """The turn that ends in this packet, if one does. What is no packet is counted."""
        if problem := packet_problem(data):
            self.counters[problem] += 1
            return None
        us = packet_us(data)
        self._follow(us, data[1204], arrived_ns)
        azimuths = [(struct.unpack_from("<H", data, at)[0] - self._cut) % 36_000 for at in _AZIMUTHS]
        turn = None
        before = self._azimuth
        for block, azimuth in enumerate(azimuths):
            if azimuth < before - 18_000:
                found = self._finish(data, us, block)
                turn = turn or found
            before = azimuth
        self._azimuth = before
        self._packets.append(data)
        self._stamps_us.append(us)
        if len(self._packets) > MAX_PACKETS:
            self.counters["overlong_turns"] += 1
            self._restart()
        return turn

    def _follow(self, us: int, mode: int, arrived_ns: int) -> None:
        usual = BLOCK_US * (BLOCKS // 2 if mode == DUAL else BLOCKS)
        step = (us - self._us) % _HOUR_US
        if self._us < 0 or mode != self._mode or step > _LOST_US:
            if self._us >= 0:
                self.counters["clock_jumps" if mode == self._mode else "mode_changes"] += 1
            self._restart()
            self._clock = DeviceClock()
        elif (missing := round(step / usual) - 1) > 0:
            self.counters["lost_packets"] += missing
        self._us, self._mode = us, mode
        self._clock.observe(us, arrived_ns - round(usual * 1000))

    def _finish(self, data: bytes, us: int, block: int) -> RawRevolution | None:
        first, packets, stamps = self._first, [*self._packets, data], [*self._stamps_us, us]
        self._packets, self._stamps_us, self._first = [], [], block
        dual = self._mode == DUAL
        last = (len(packets) - 1) * BLOCKS + block
        if first is None:
            return None
        if last - first < MIN_BLOCKS:
            self.counters["short_turns"] += 1
            return None
        begun_us = first // (2 if dual else 1) * BLOCK_US
        return RawRevolution(
            packets=b"".join(packets),
            us=tuple((one - stamps[0]) % _HOUR_US for one in stamps),
            first=first,
            last=last,
            stamp_ns=self._clock.wall_ns(stamps[0]) + round(begun_us * 1000),
            mode=self._mode,
        )

    def _restart(self) -> None:
        self._packets, self._stamps_us, self._first, self._azimuth = [], [], None, -1


class DeviceClock:
    """The device's clock by this machine's: packets come late, never early, so that the least delay is the truth."""

    def __init__(self) -> None:
        self._us = 0
        self._total_us = 0
        self._offset_ns: int | None = None

    def observe(self, us: int, arrived_ns: int) -> None:
        """A packet of that time came then."""
        if self._offset_ns is not None:
            self._total_us += (us - self._us) % _HOUR_US
        self._us = us
        offset = arrived_ns - self._total_us * 1000
        self._offset_ns = offset if self._offset_ns is None else min(offset, self._offset_ns + _DRIFT_NS)

    def wall_ns(self, us: int) -> int:
        """This machine's time when the device's clock said `us`, at or before the last packet."""
        assert self._offset_ns is not None
        return self._offset_ns + (self._total_us - (self._us - us) % _HOUR_US) * 1000


def decode(turn: RawRevolution) -> npt.NDArray[np.void]:
    """The turn's points; `time` in s since its `stamp_ns`, lost packets and all."""
    packets = np.frombuffer(turn.packets, PACKET_DTYPE)
    blocks = packets["blocks"].reshape(-1)[turn.first : turn.last]
    starts_us = np.repeat(np.array(turn.us, np.float64), BLOCKS)[turn.first : turn.last]
    within = np.tile(np.arange(BLOCKS) // (2 if turn.dual else 1) * BLOCK_US, len(packets))[turn.first : turn.last]
    return points_of(
        blocks["azimuth"].astype(np.int64), blocks["returns"], begun_us=_since_first(starts_us + within), dual=turn.dual
    )


def _since_first(us: npt.NDArray[np.float64]) -> npt.NDArray[np.float32]:
    return (us - us[0]).astype(np.float32) if len(us) else us.astype(np.float32)
