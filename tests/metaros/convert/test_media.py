"""Audio samples and video packets."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from metaros.cdr import codec
from metaros.convert import (
    audio_to_numpy,
    foxglove_to_video,
    is_key_frame,
    numpy_to_audio,
    video_packet,
    video_to_foxglove,
)
from metaros.errors import DecodeError, FieldError
from metaros.interfaces.foxglove_msgs.msg import CompressedVideo, RawAudio
from metaros.interfaces.metaros_msgs.msg import VideoPacket
from tests.support.tables import cases

H264_KEY = b"\0\0\0\1\x67\x42\0\0\0\1\x68\xce\0\0\1\x65\x88\x84"
H264_DELTA = b"\0\0\0\1\x41\x9a\x02"
H265_KEY = b"\0\0\0\1\x40\x01\0\0\1\x26\x01\xaf"
H265_DELTA = b"\0\0\1\x02\x01\xd0"


@cases("shape", [(480,), (480, 1), (480, 2), (0, 2)])
def test_samples_come_back(shape: tuple[int, ...]) -> None:
    samples = (np.arange(np.prod(shape)) * 77 % 65536 - 32768).astype(np.int16).reshape(shape)
    message = numpy_to_audio(samples, 48_000, stamp_ns=5)
    channels = shape[1] if len(shape) > 1 else 1
    assert (message.format, message.sample_rate, message.number_of_channels) == ("pcm-s16", 48_000, channels)
    assert np.shares_memory(message.data, samples) or not samples.size
    received = codec(RawAudio).decode(codec(RawAudio).encode(message))
    assert (audio_to_numpy(received) == samples.reshape(-1, channels)).all()
    assert audio_to_numpy(received).dtype == np.int16


def test_floats_are_scaled_and_cut_off() -> None:
    message = numpy_to_audio(np.array([0.0, 0.5, -1.0, 1.0, 7.0, -7.0]), 8000)
    assert audio_to_numpy(message)[:, 0].tolist() == [0, 16384, -32768, 32767, 32767, -32768]
    back = audio_to_numpy(message, np.float32)
    assert back.dtype == np.float32
    assert back[:3, 0].tolist() == [0.0, 0.5, -1.0]


@cases(
    ("samples", "rate", "message"),
    [
        (np.zeros(4, "u1"), 8000, "samples are int16 or floats, not uint8"),
        (np.zeros((2, 2, 2), "i2"), 8000, "not of 3 dimensions"),
        (np.zeros((2, 480), "i2"), 8000, "480 channels: 1 to 64"),
        (np.zeros(4, "i2"), 0, "sample_rate: 0"),
        (np.array([np.nan]), 8000, "a sample is NaN"),
    ],
)
def test_what_is_no_audio_is_refused(samples: Any, rate: int, message: str) -> None:
    with pytest.raises(FieldError, match=message):
        numpy_to_audio(samples, rate)


@cases(
    ("change", "message"),
    [
        ({"format": "opus"}, "the audio format 'opus' is not pcm-s16"),
        ({"number_of_channels": 0}, "no whole samples of 0 channels"),
        ({"data": b"abc"}, "3 bytes are no whole samples"),
    ],
)
def test_audio_of_a_careless_peer_is_a_decode_error(change: dict[str, Any], message: str) -> None:
    audio = numpy_to_audio(np.zeros(4, "i2"), 8000)
    for name, value in change.items():
        setattr(audio, name, value)
    with pytest.raises(DecodeError, match=message):
        audio_to_numpy(audio)
    with pytest.raises(FieldError, match="not int32"):
        audio_to_numpy(audio, np.int32)


@cases(
    ("data", "name", "key"),
    [
        (H264_KEY, "h264", True),
        (H264_DELTA, "h264", False),
        (H265_KEY, "h265", True),
        (H265_DELTA, "h265", False),
        (b"\x10\x02", "vp8", True),
        (b"\x11\x02", "vp8", False),
        (b"", "h264", False),
        (b"", "vp8", False),
    ],
)
def test_key_frames_are_read_from_the_data(data: bytes, name: str, key: bool) -> None:
    assert is_key_frame(data, name) is key
    assert video_packet(data, name, pts_ns=1).key_frame is key


def test_a_packet_keeps_what_an_encoder_said() -> None:
    packet = video_packet(
        H264_KEY, "h264", pts_ns=40_000_000, stamp_ns=3_000_000_007, width=640, height=360, frame_id="cam"
    )
    received = codec(VideoPacket).decode(codec(VideoPacket).encode(packet))
    assert (received.codec, received.key_frame, received.pts, received.width, received.height) == (
        "h264",
        True,
        40_000_000,
        640,
        360,
    )
    assert (received.header.stamp.sec, received.header.stamp.nanosec, received.header.frame_id) == (3, 7, "cam")
    assert received.data.tobytes() == H264_KEY


def test_viewers_get_foxgloves_message_and_back() -> None:
    shown = video_to_foxglove(video_packet(H264_KEY, "h264", pts_ns=9, stamp_ns=3_000_000_007, frame_id="cam"))
    received = codec(CompressedVideo).decode(codec(CompressedVideo).encode(shown))
    assert (received.format, received.frame_id, received.timestamp.nanosec) == ("h264", "cam", 7)
    packet = foxglove_to_video(received)
    assert (packet.codec, packet.key_frame, packet.pts, packet.header.stamp.sec) == ("h264", True, 3_000_000_007, 3)
    assert packet.data.tobytes() == H264_KEY


def test_unknown_codecs_are_reported() -> None:
    with pytest.raises(FieldError, match="codec: 'mpeg2' is none of h264, h265, vp8, vp9, av1"):
        video_packet(b"", "mpeg2", pts_ns=0)
    with pytest.raises(FieldError, match="say key_frame="):
        video_packet(b"x", "av1", pts_ns=0)
    assert video_packet(b"x", "av1", pts_ns=0, key_frame=True).key_frame
    with pytest.raises(DecodeError, match="the video format 'mjpeg'"):
        foxglove_to_video(CompressedVideo(format="mjpeg"))
    with pytest.raises(DecodeError, match="the codec ''"):
        video_to_foxglove(VideoPacket())


def test_times_beyond_what_ros_counts_are_refused() -> None:
    with pytest.raises(FieldError, match="stamp_ns: -1 is no time"):
        numpy_to_audio(np.zeros(1, "i2"), 8000, stamp_ns=-1)
