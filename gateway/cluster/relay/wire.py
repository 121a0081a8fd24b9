"""A robot's frame on its way between two gateways: robot id, a number, and the frame's bytes."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from gateway.errors import ProtocolError

__all__ = ["RelayedFrame", "join", "split"]

_HEAD = struct.Struct(">HQ")  # bytes of the robot's id, and the number
_SIZE = struct.Struct(">I")


@dataclass(frozen=True, slots=True)
class RelayedFrame:
    """`number` is what the topic makes of it; `frame` is a serialized frame of the link, or b""."""

    robot: str
    frame: bytes = b""
    number: int = 0

    def pack(self) -> bytes:
        """As it crosses."""
        robot = self.robot.encode()
        return _HEAD.pack(len(robot), self.number) + robot + self.frame

    @classmethod
    def unpack(cls, payload: bytes) -> RelayedFrame:
        """What came; ProtocolError where it is none."""
        try:
            size, number = _HEAD.unpack_from(payload)
            robot = payload[_HEAD.size : _HEAD.size + size].decode()
        except (struct.error, UnicodeDecodeError) as error:
            raise ProtocolError(f"a relayed frame of {len(payload)} bytes cannot be read") from error
        return cls(robot, payload[_HEAD.size + size :], number)


def join(parts: Iterable[bytes]) -> bytes:
    """Several as one."""
    return b"".join(_SIZE.pack(len(part)) + part for part in parts)


def split(payload: bytes) -> Iterator[bytes]:
    """The parts of one; ProtocolError where there are none."""
    start = 0
    while start < len(payload):
        try:
            (size,) = _SIZE.unpack_from(payload, start)
        except struct.error as error:
            raise ProtocolError("parts cannot be read") from error
        start += _SIZE.size
        if start + size > len(payload):
            raise ProtocolError("the last part is cut off")
        yield payload[start : start + size]
        start += size
