"""From bytes to epochs: frames, parsed by pynmeagps and pyubx2, put together. Knows no device."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, Final

from pynmeagps import NMEAReader
from pyubx2 import SET, UBXMessage, UBXReader

from metaros.drivers.gps.epoch import Epoch, from_nmea, from_pvt
from metaros.drivers.gps.splitter import GpsSplitter
from metaros.drivers.message_groups import MessageGroups

__all__ = ["PREFER_UBX_S", "EpochReader", "pvt_request"]

PREFER_UBX_S: Final = 3.0
_NMEA: Final = ("GGA", "RMC", "GST", "VTG")
_NAV_PVT: Final = b"\xb5\x62\x01\x07"
_SHORTEST_PVT: Final = 8 + 84  # of u-blox 7; 92 bytes later


class EpochReader:
    """Where a receiver talks both, NAV-PVT is taken and NMEA is left, until there was none for PREFER_UBX_S."""

    def __init__(self, count: Callable[[str, int], object]) -> None:
        self._count = count
        self._splitter = GpsSplitter(count)
        self._groups = MessageGroups()
        self._pvt_s: float | None = None

    def feed(self, data: bytes, now_s: float) -> Iterator[Epoch]:
        """Epochs that these bytes complete. Empty `data` (the line is quiet) completes what has come."""
        for frame in self._splitter.feed(data):
            self._count("frames", 1)
            if frame.startswith(_NAV_PVT):
                yield from self._ubx(frame, now_s)
            elif not frame.startswith(b"\xb5") and (self._pvt_s is None or now_s - self._pvt_s > PREFER_UBX_S):
                yield from self._nmea(frame)
        if not data:
            yield from _made(self._groups.flush())

    def _ubx(self, frame: bytes, now_s: float) -> Iterator[Epoch]:
        if len(frame) < _SHORTEST_PVT:  # pyubx2 would fill it up with zeros
            self._count("bad_messages", 1)
            return
        message = self._parsed(UBXReader.parse, frame)
        if message is not None:
            self._pvt_s = now_s
            yield from_pvt(message)

    def _nmea(self, frame: bytes) -> Iterator[Epoch]:
        if frame[3:6].decode("ascii", "replace") not in _NMEA:
            return
        message = self._parsed(NMEAReader.parse, frame)
        if message is not None and message.msgID in _NMEA:
            moment = getattr(message, "time", None) or None
            yield from _made(self._groups.feed(message.msgID, message, moment=moment))

    def _parsed(self, parse: Callable[..., Any], frame: bytes) -> Any:
        """A library's parser may raise anything of a frame that is sound and says nonsense."""
        try:
            return parse(frame, validate=0)
        except Exception:
            self._count("bad_messages", 1)
            return None


def _made(rounds: Iterator[Any]) -> Iterator[Epoch]:
    for items in rounds:
        epoch = from_nmea(items)
        if epoch is not None:
            yield epoch


def pvt_request() -> bytes:
    """UBX-CFG-MSG that asks for NAV-PVT with each fix, on the port that it comes by."""
    message = UBXMessage("CFG", "CFG-MSG", SET, payload=b"\x01\x07\x01")
    return bytes(message.serialize())
