"""H.264 as viewers need it: decodable from every key frame, in order, with parameter sets, nothing held back."""

from __future__ import annotations

import io

import av
import numpy as np
import pytest

from metaros.convert import is_key_frame
from metaros.drivers.camera.encoders import H264Encoder
from metaros.drivers.camera.ladder import Rung
from metaros.drivers.camera.source import TestPattern
from metaros.errors import ConfigError

RUNG = Rung(320, 240, 500_000)


def decoded(units: list[bytes]) -> list[np.ndarray]:
    decoder = av.CodecContext.create("h264", "r")
    frames = [frame for unit in units for frame in decoder.decode(av.Packet(unit))]
    return [frame.to_ndarray(format="bgr24") for frame in [*frames, *decoder.decode(None)]]


def count_of(image: np.ndarray) -> int:
    """The number that the pattern shows in Gray code."""
    height, width = image.shape[:2]
    bits = [image[height - height // 32, bit * width // 12 + width // 24].mean() > 127 for bit in range(12)]
    code = sum(1 << n for n, bit in enumerate(bits) if bit)
    number = 0
    while code:
        number ^= code
        code >>= 1
    return number


def test_every_picture_comes_at_once_and_in_order() -> None:
    pattern, encoder = TestPattern(320, 240), H264Encoder(RUNG, rate=10, warn=pytest.fail)
    units = [encoder.encode(pattern.read(), key_frame=False) for _ in range(50)]
    assert all(units)
    assert [count_of(image) for image in decoded(units)] == list(range(50))
    keys = [n for n, unit in enumerate(units) if is_key_frame(unit, "h264")]
    assert keys == [0, 20, 40]  # at least every two seconds


def test_a_key_frame_comes_when_it_is_asked_for_and_stands_alone() -> None:
    pattern, encoder = TestPattern(320, 240), H264Encoder(RUNG, rate=30, warn=pytest.fail)
    units = [encoder.encode(pattern.read(), key_frame=n == 17) for n in range(30)]
    assert [n for n, unit in enumerate(units) if is_key_frame(unit, "h264")] == [0, 17]
    assert [count_of(image) for image in decoded(units[17:])] == list(range(17, 30))
    kinds = [part[0] & 0x1F for part in io.BytesIO(units[17]).getvalue().split(b"\0\0\1")[1:]]
    assert kinds.index(7) < kinds.index(8) < kinds.index(5)


def test_pictures_of_another_size_are_scaled() -> None:
    encoder = H264Encoder(RUNG, rate=30, warn=pytest.fail)
    units = [encoder.encode(TestPattern(641, 359).read(), key_frame=False) for _ in range(3)]
    assert {image.shape for image in decoded(units)} == {(240, 320, 3)}


def test_an_encoder_that_is_not_there_is_replaced_and_reported() -> None:
    reported: list[str] = []
    encoder = H264Encoder(RUNG, rate=30, name="h264_v4l2m2m", warn=reported.append)
    assert encoder.name == "libx264"
    assert "h264_v4l2m2m" in reported[0]
    assert encoder.encode(TestPattern(320, 240).read(), key_frame=False)


def test_what_is_no_encoder_at_all_is_replaced_too() -> None:
    reported: list[str] = []
    assert H264Encoder(RUNG, rate=30, name="no_such_encoder", warn=reported.append).name == "libx264"
    assert reported


def test_a_rate_that_ffmpeg_cannot_have_is_refused() -> None:
    with pytest.raises(ConfigError):
        H264Encoder(Rung(0, 0, 0), rate=30, warn=pytest.fail)
