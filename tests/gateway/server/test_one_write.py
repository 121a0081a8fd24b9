"""An answer's first two pieces are one write, unless the second one takes its time."""

from __future__ import annotations

import asyncio
from collections.abc import Iterable
from typing import Any

from gateway.server.one_write import OneWrite


class Wire:
    """A transport that notes what is done to it."""

    def __init__(self) -> None:
        self.seen: list[bytes] = []

    def write(self, data: bytes) -> None:
        self.seen.append(data)

    def writelines(self, pieces: Iterable[bytes]) -> None:
        self.seen.append(b"".join(pieces))

    def close(self) -> None:
        self.seen.append(b"<end>")

    def is_closing(self) -> bool:
        return b"<end>" in self.seen


async def test_what_follows_at_once_goes_along() -> None:
    wire: Any = Wire()
    answer = OneWrite(wire, asyncio.get_running_loop())
    for piece in (b"head ", b"body", b" more", b""):
        answer.write(piece)
    await asyncio.sleep(0)
    assert wire.seen == [b"head body", b" more"]
    assert not answer.is_closing()


async def test_a_head_does_not_wait_for_a_slow_body() -> None:
    wire: Any = Wire()
    answer = OneWrite(wire, asyncio.get_running_loop())
    answer.write(b"head")
    assert wire.seen == []
    await asyncio.sleep(0)
    answer.write(b"body")
    assert wire.seen == [b"head", b"body"]


async def test_nothing_is_left_behind_at_the_end() -> None:
    for pieces, seen in (([b"head"], [b"head"]), ([b"head", b""], [b"head"]), ([], [])):
        wire: Any = Wire()
        answer = OneWrite(wire, asyncio.get_running_loop())
        for piece in pieces:
            answer.write(piece)
        answer.close()
        await asyncio.sleep(0)
        assert wire.seen == [*seen, b"<end>"]
        assert answer.is_closing()
