"""Video packets: an encoder's output as metaros_msgs/VideoPacket, and foxglove_msgs/CompressedVideo for viewers.

A viewer that joins starts at a packet with `key_frame`. H.264 and H.265 are Annex B with parameter sets in front of
each key frame, as the encoders of FFmpeg give them with `repeat-headers`.
"""

from __future__ import annotations

import re
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from metaros.convert.stamps import header, stamp_ns_of
from metaros.errors import DecodeError, FieldError
from metaros.idl.arrays import as_array
from metaros.interfaces.foxglove_msgs.msg import CompressedVideo
from metaros.interfaces.metaros_msgs.msg import VideoPacket

__all__ = ["CODECS", "foxglove_to_video", "is_key_frame", "video_packet", "video_to_foxglove"]

CODECS: Final = ("h264", "h265", "vp8", "vp9", "av1")
Readable = bytes | bytearray | memoryview | npt.NDArray[np.uint8]
_START: Final = re.compile(rb"\x00\x00\x01(.)", re.DOTALL)
_H264_KEY: Final = 5
_H265_KEYS: Final = range(16, 22)


def video_packet(
    data: Readable,
    codec: str,
    *,
    pts_ns: int,
    stamp_ns: int = 0,
    key_frame: bool | None = None,
    width: int = 0,
    height: int = 0,
    frame_id: str = "",
) -> VideoPacket:
    """A packet of one frame. `pts_ns` is when it is to be shown, `stamp_ns` when it was captured.

    Whether it is a key frame is read from the data of H.264, H.265 and VP8; for other codecs it must be said.
    """
    if codec not in CODECS:
        raise FieldError(f"codec: {codec!r} is none of {', '.join(CODECS)}")
    found = is_key_frame(data, codec) if key_frame is None else key_frame
    return VideoPacket(
        header=header(stamp_ns, frame_id),
        codec=codec,
        key_frame=found,
        pts=pts_ns,
        width=width,
        height=height,
        data=as_array(data, "uint8"),
    )


def is_key_frame(data: Readable, codec: str) -> bool:
    """Whether decoding can begin with this packet of H.264, H.265 (Annex B) or VP8."""
    raw = as_array(data, "uint8").tobytes()
    if codec == "h264":
        return any(match[1][0] & 0x1F == _H264_KEY for match in _START.finditer(raw))
    if codec == "h265":
        return any((match[1][0] >> 1) & 0x3F in _H265_KEYS for match in _START.finditer(raw))
    if codec == "vp8":
        return bool(raw) and not raw[0] & 1
    raise FieldError(f"codec: key frames of {codec!r} are not told apart here: say key_frame=")


def video_to_foxglove(packet: Any) -> CompressedVideo:
    """The packet as Foxglove and Lichtblick show it; what it has no field for is left out."""
    if packet.codec not in CODECS:
        raise DecodeError(f"the codec {str(packet.codec)[:40]!r} is none of {', '.join(CODECS)}")
    return CompressedVideo(
        timestamp=packet.header.stamp, frame_id=packet.header.frame_id, data=packet.data, format=packet.codec
    )


def foxglove_to_video(message: Any, *, key_frame: bool | None = None) -> VideoPacket:
    """The reverse: the time of capture is also when it is to be shown."""
    codec = message.format
    if codec not in CODECS:
        raise DecodeError(f"the video format {str(codec)[:40]!r} is none of {', '.join(CODECS)}")
    stamp_ns = stamp_ns_of(message.timestamp)
    return video_packet(
        message.data, codec, pts_ns=stamp_ns, stamp_ns=stamp_ns, key_frame=key_frame, frame_id=message.frame_id
    )
