"""Cursors: where a page of messages ended, as a text that a client gives back unread."""

from __future__ import annotations

import base64
import binascii
import struct

from gateway.errors import InvalidRequestError
from gateway.history.messages import MessageKey

__all__ = ["read_cursor", "write_cursor"]

_FORMAT = struct.Struct("<BqQQQ")
_ASCENDING, _DESCENDING = 1, 2


def write_cursor(place: MessageKey, *, newest_first: bool) -> str:
    """The text for a page that ended with the message at `place`."""
    packed = _FORMAT.pack(_DESCENDING if newest_first else _ASCENDING, *place)
    return base64.urlsafe_b64encode(packed).rstrip(b"=").decode()


def read_cursor(text: str, *, newest_first: bool) -> MessageKey:
    """Where to go on; InvalidRequestError for a text that is no cursor of pages in this order."""
    try:
        order, stamp_ns, stream_id, epoch, seq = _FORMAT.unpack(base64.urlsafe_b64decode(text + "=" * (-len(text) % 4)))
    except (binascii.Error, ValueError, struct.error):
        raise InvalidRequestError("cursor is not one that an answer gave as `next`") from None
    if order != (_DESCENDING if newest_first else _ASCENDING):
        raise InvalidRequestError("cursor belongs to pages in the other order")
    return (stamp_ns, stream_id, epoch, seq)
