"""Long messages in pieces, and JSON as a picture: the ops `fragment` and `png`. Pure.

A fragment's data is a part of the message's JSON text, which may be cut anywhere between two characters. What a client
sends in pieces is bounded: in bytes of all its unfinished messages together, in their number, and in time.
"""

from __future__ import annotations

import base64
import io
import math
from dataclasses import dataclass, field
from typing import Any, TypeGuard

from gateway.api.rosbridge.from_message import json_bytes
from gateway.errors import BodyTooLargeError, InvalidRequestError
from metaros.limits import LIMITS, Limits

__all__ = ["Assembler", "fragments", "png_message"]

MAX_PIECES = 65536  # of one message that a client sends
MAX_CUT = 1024  # of one that it gets: cutting a picture into its letters would hold everybody up
MAX_UNFINISHED = 64  # messages of one client


def fragments(text: str, *, size: int, name: str) -> list[bytes]:
    """The JSON texts that carry `text` in pieces of `size` characters, larger ones where those would be too many."""
    if len(text) <= size:
        return [text.encode()]
    size = max(size, 1, -(-len(text) // MAX_CUT))
    parts = [text[start : start + size] for start in range(0, len(text), size)]
    shared = {"op": "fragment", "id": name, "total": len(parts)}
    return [json_bytes({**shared, "num": number, "data": part}) for number, part in enumerate(parts)]


def png_message(text: bytes) -> bytes:
    """The `png` op of a JSON text: a picture whose pixels' bytes are the text, filled up with line feeds."""
    from PIL import Image  # few clients ask for pictures

    pixels = -(-len(text) // 3)
    width = max(1, math.isqrt(pixels))
    height = max(1, -(-pixels // width))
    filled = text.ljust(width * height * 3, b"\n")
    file = io.BytesIO()
    Image.frombytes("RGB", (width, height), filled).save(file, format="PNG", compress_level=1)
    return json_bytes({"op": "png", "data": base64.b64encode(file.getvalue()).decode()})


@dataclass(slots=True)
class _Unfinished:
    """What has come of one message."""

    total: int
    begun_s: float
    parts: dict[int, str] = field(default_factory=dict)
    chars: int = 0


class Assembler:
    """Puts one client's fragments together, in whatever order they come."""

    def __init__(self, *, limits: Limits = LIMITS) -> None:
        self._limits = limits
        self._unfinished: dict[str, _Unfinished] = {}
        self._chars = 0

    @property
    def waiting_chars(self) -> int:
        """Characters of unfinished messages."""
        return self._chars

    def add(self, fragment: dict[str, Any], *, now_s: float) -> str | None:
        """Take a `fragment` op in; the whole text when it was the last one missing.

        Raises:
            InvalidRequestError: it is none, or does not fit what came before it.
            BodyTooLargeError: the unfinished messages are too long together; this one is given up.
        """
        self._forget_old(now_s)
        name, number, total, data = _checked(fragment)
        known = self._unfinished.get(name)
        if known is None:
            if len(self._unfinished) >= MAX_UNFINISHED:
                self._forget(next(iter(self._unfinished)))
            known = self._unfinished[name] = _Unfinished(total, now_s)
        if known.total != total:
            self._forget(name)
            raise InvalidRequestError(f"fragment {name[:80]!r}: total was {known.total} before and is {total} now")
        if number in known.parts:
            return None
        known.parts[number] = data
        known.chars += len(data)
        self._chars += len(data)
        if self._chars > self._limits.rosbridge_message_bytes:
            self._forget(name)
            raise BodyTooLargeError(
                f"a message has at most {self._limits.rosbridge_message_bytes} bytes, in pieces too"
            )
        if len(known.parts) < total:
            return None
        self._forget(name)
        return "".join(known.parts[index] for index in range(total))

    def _forget(self, name: str) -> None:
        self._chars -= self._unfinished.pop(name).chars

    def _forget_old(self, now_s: float) -> None:
        """Those that began too long ago; they are in the order in which they began."""
        while self._unfinished:
            name, oldest = next(iter(self._unfinished.items()))
            if now_s - oldest.begun_s < self._limits.rosbridge_fragment_s:
                return
            self._forget(name)


def _checked(fragment: dict[str, Any]) -> tuple[str, int, int, str]:
    name, data = fragment.get("id"), fragment.get("data")
    number, total = fragment.get("num"), fragment.get("total")
    if not isinstance(name, str) or not name or not isinstance(data, str):
        raise InvalidRequestError("a fragment has an id and data, which are texts")
    if not _whole(number) or not _whole(total) or not 0 < total <= MAX_PIECES or not 0 <= number < total:
        raise InvalidRequestError(f"a fragment has num from 0 to total - 1, and total from 1 to {MAX_PIECES}")
    return name, number, total, data


def _whole(value: Any) -> TypeGuard[int]:
    return isinstance(value, int) and not isinstance(value, bool)
