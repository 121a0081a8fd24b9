"""The gateway's JSON of a live sample: made once, for all who want it."""

from __future__ import annotations

import threading

import orjson

from gateway.domain.channel import Channel
from gateway.domain.decoder import Decoder
from gateway.domain.records import Record

__all__ = ["json_view"]

_local = threading.local()  # views are made on the loop and in a thread; a decoder is for one of them


def json_view(channel: Channel, record: Record) -> bytes:
    """The message as JSON in UTF-8, as REST shows it; MetarosError where it cannot be decoded."""
    decoder: Decoder | None = getattr(_local, "decoder", None)
    if decoder is None:
        decoder = _local.decoder = Decoder()
    return orjson.dumps(decoder.decode(channel, record.payload))
