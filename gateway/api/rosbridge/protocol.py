"""One rosbridge connection without its socket: frames in, requests out; answers in, frames out. Pure.

Statuses go to who wants them (`set_level`), with the id of what they are about. Long answers go in pieces, as a
picture or as CBOR where their request said so.
"""

from __future__ import annotations

from itertools import count
from typing import Any

import cbor2

from gateway.api.problem import error_code
from gateway.api.rosbridge.fragmentation import Assembler, fragments, png_message
from gateway.api.rosbridge.from_message import json_bytes
from gateway.api.rosbridge.requests import LEVELS, Request, SetLevel, Shape, read_object, read_request
from metaros.errors import MetarosError
from metaros.limits import LIMITS, Limits

__all__ = ["PLAIN", "Frame", "Protocol", "shaped"]

PLAIN = Shape()
STATUS_CHARS = 1000

Frame = tuple[bool, bytes]  # whether it is a text, and its payload


def shaped(message: Any, shape: Shape, *, name: str) -> list[Frame]:
    """The frames of an op: JSON, or CBOR or a picture of it, whole or in pieces named `name`."""
    if shape.compression in ("cbor", "cbor-raw"):
        return [(False, cbor2.dumps(message))]
    text = json_bytes(message)
    if shape.compression == "png":
        text = png_message(text)
    if shape.fragment_size is None or len(text) <= shape.fragment_size:
        return [(True, text)]
    return [(True, piece) for piece in fragments(text.decode(), size=shape.fragment_size, name=name)]


class Protocol:
    """Frames of one client."""

    def __init__(self, *, limits: Limits = LIMITS) -> None:
        self._assembler = Assembler(limits=limits)
        self._level = LEVELS.index("error")
        self._names = count(1)

    def receive(self, frame: str | bytes, *, now_s: float) -> tuple[Request | None, list[Frame]]:
        """Take a frame in: a request that is to be carried out, if it completes one, and what to answer at once."""
        said: Any = None
        try:
            found = read_object(frame)
            said = found.get("id")
            if found.get("op") == "fragment":
                text = self._assembler.add(found, now_s=now_s)
                if text is None:
                    return None, []
                found, frame = read_object(text), text
                said = found.get("id")
            request = read_request(found, chars=len(frame))
        except MetarosError as error:
            return None, self.fault(error, said if isinstance(said, str) else None)
        if isinstance(request, SetLevel):
            self._level = LEVELS.index(request.level)
            return None, []
        return request, []

    def status(self, level: str, text: str, about: str | None = None, *, code: str = "") -> list[Frame]:
        """A status of that level about a request's id; nothing where the client does not want it."""
        if LEVELS.index(level) > self._level:
            return []
        message = {"op": "status", "level": level, "msg": text[:STATUS_CHARS]}
        more = {"id": about, "code": code or None}
        return self.answer({**message, **{name: value for name, value in more.items() if value is not None}})

    def fault(self, error: MetarosError, about: str | None = None) -> list[Frame]:
        """The status of an error; `code` is an addition of ours, its stable code."""
        return self.status("error", str(error), about, code=error_code(error))

    def answer(self, message: Any, shape: Shape = PLAIN) -> list[Frame]:
        """The frames of an op that answers."""
        return shaped(message, shape, name=f"answer:{next(self._names)}")
