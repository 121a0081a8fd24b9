"""How ZeroMQ programs write a message, and how the broker reads and writes it. Pure.

Two spellings are understood: one frame `topic payload`, split at the first space (the wire of `metaros` 1.x, whose
payload is JSON), and two frames, the topic and the payload. A topic may begin with a slash or not.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from metaros.errors import FrameError, NameError_
from metaros.wire.names import check_fqn

__all__ = ["join", "parse_payload", "ros_topic", "split"]

_SHOWN = 40


def split(frames: Sequence[bytes]) -> tuple[bytes, bytes]:
    """The topic as it was written, and the payload; FrameError for what is neither one frame nor two."""
    if len(frames) == 1:
        topic, space, payload = frames[0].partition(b" ")
        if space and topic:
            return topic, payload
        raise FrameError(f"{_shown(frames[0])} is no message: it has no `topic payload`")
    if len(frames) == 2:
        return frames[0], frames[1]
    raise FrameError(f"a message of {len(frames)} frames: one (`topic payload`) or two (topic, payload) are understood")


def join(topic: bytes, payload: bytes, *, two_frames: bool) -> list[bytes]:
    """The reverse of `split`."""
    return [topic, payload] if two_frames else [b"%b %b" % (topic, payload)]


def ros_topic(topic: bytes) -> str:
    """The ROS name of a ZeroMQ topic, with its leading slash; FrameError where ROS allows no such name."""
    try:
        return "/" + check_fqn(topic.decode("ascii"))
    except (UnicodeDecodeError, NameError_):
        raise FrameError(
            f"the topic {_shown(topic)} is no ROS name: parts of letters, digits and _, joined by single slashes"
        ) from None


def parse_payload(payload: bytes) -> Any:
    """What a payload says: the JSON value, else its text, else the bytes themselves.

    FrameError for text that begins like a JSON object or list and is none.
    """
    try:
        return json.loads(payload)
    except UnicodeDecodeError:
        return payload
    except (ValueError, RecursionError) as error:
        if payload.lstrip()[:1] in (b"{", b"["):
            raise FrameError(f"{_shown(payload)} is no JSON: {error}") from None
    try:
        return payload.decode()
    except UnicodeDecodeError:
        return payload


def _shown(data: bytes) -> str:
    """The beginning of foreign bytes, safe for a terminal."""
    text = ascii(data[:_SHOWN])[2:-1]
    return f"{text!r}…" if len(data) > _SHOWN else repr(text)
