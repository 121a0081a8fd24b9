"""The encoding of messages between gateways, before they are sealed; a large one goes in pieces."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum
from typing import Final

__all__ = ["MESSAGE_BYTES", "PIECE_BYTES", "Joiner", "Kind", "Message", "pieces"]

MESSAGE_BYTES: Final = 17 * 1024 * 1024  # of a payload: a sample of 16 MiB, and what is said of it
PIECE_BYTES: Final = 256 * 1024
NAME_BYTES: Final = 64
_MORE: Final = 0x80  # in the kind: another piece follows
_HEAD: Final = struct.Struct(">BIIQIB")


class Kind(IntEnum):
    """What a message is."""

    HELLO = 1  # the sender sees the receiver, and says how often it has met it
    TELL = 2
    ASK = 3
    ANSWER = 4
    REFUSAL = 5


@dataclass(frozen=True, slots=True)
class Message:
    """`mine` counts the sender's meetings with the receiver, `yours` is the receiver's count as the sender knows it."""

    kind: Kind
    mine: int
    yours: int
    number: int = 0  # of a question, in its answer too
    timeout_ms: int = 0  # of a question
    name: str = ""  # topic or verb
    payload: bytes = b""


def pieces(message: Message) -> Iterator[bytes]:
    """What is sealed and sent, one after another."""
    name, payload = message.name.encode(), message.payload
    if len(name) > NAME_BYTES or len(payload) > MESSAGE_BYTES:
        raise ValueError(f"{message.name}: a name has at most {NAME_BYTES} bytes, a payload {MESSAGE_BYTES}")
    starts = range(0, len(payload), PIECE_BYTES) or range(1)
    for start in starts:
        more = _MORE if start + PIECE_BYTES < len(payload) else 0
        facts = (message.kind | more, message.mine, message.yours, message.number, message.timeout_ms, len(name))
        yield _HEAD.pack(*facts) + name + payload[start : start + PIECE_BYTES]


class Joiner:
    """Makes messages of one sender's pieces, which come in order."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []
        self._bytes = 0

    def take(self, piece: bytes) -> Message | None:
        """The message that this one completes; None: more is to come. ValueError for what is none."""
        try:
            kind, mine, yours, number, timeout_ms, length = _HEAD.unpack_from(piece)
        except struct.error as error:
            raise ValueError("a piece without its head") from error
        start = _HEAD.size + length
        self._parts.append(piece[start:])
        self._bytes += len(piece) - start
        if self._bytes > MESSAGE_BYTES:
            self.drop()
            raise ValueError(f"a message of more than {MESSAGE_BYTES} bytes")
        if kind & _MORE:
            return None
        payload = b"".join(self._parts)
        self.drop()
        return Message(Kind(kind), mine, yours, number, timeout_ms, piece[_HEAD.size : start].decode(), payload)

    def drop(self) -> None:
        """Forget what there is of a message whose rest is lost."""
        self._parts.clear()
        self._bytes = 0
