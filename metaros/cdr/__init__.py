"""CDR, the wire format of ROS 2 messages: compiled codecs and field readers."""

from __future__ import annotations

from metaros.cdr.codec import Codec, codec
from metaros.cdr.reader import field_reader

__all__ = ["Codec", "codec", "field_reader"]
