"""Sources: the test pattern moves, a file repeats, what is not there says so."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from metaros.drivers.camera.node import encode_jpeg
from metaros.drivers.camera.parameters import CameraParameters
from metaros.drivers.camera.source import TestPattern, VideoSource, open_source
from metaros.errors import UnavailableError


@pytest.fixture
def video(tmp_path: Path) -> Path:
    path = tmp_path / "five.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 10, (64, 48))
    for value in range(5):
        writer.write(np.full((48, 64, 3), 50 * value, np.uint8))
    writer.release()
    return path


def test_the_pattern_changes_with_every_image() -> None:
    pattern = TestPattern(640, 360)
    images = [pattern.read() for _ in range(50)]
    assert all(image.shape == (360, 640, 3) for image in images)
    assert len({image.tobytes() for image in images}) == 50


@pytest.mark.parametrize("size", [(16, 16), (640, 360), (321, 77)])
def test_any_size_works(size: tuple[int, int]) -> None:
    source = open_source(CameraParameters(source="test", width=size[0], height=size[1]))
    assert source.read().shape == (size[1], size[0], 3)
    source.close()


def test_a_file_plays_and_starts_again(video: Path) -> None:
    source = VideoSource(str(video), width=64, height=48)
    means = [round(float(source.read().mean()) / 50) for _ in range(8)]
    source.close()
    assert means == [0, 1, 2, 3, 4, 0, 1, 2]


@pytest.mark.parametrize("name", ["/no/such/file.mp4", "97"])
def test_what_is_not_there_is_unavailable(name: str) -> None:
    with pytest.raises(UnavailableError):
        VideoSource(name, width=64, height=48)


def test_a_file_that_is_no_video(tmp_path: Path) -> None:
    path = tmp_path / "no.mp4"
    path.write_bytes(b"hello" * 100)
    with pytest.raises(UnavailableError, match="cannot open"):
        VideoSource(str(path), width=64, height=48)


def test_jpeg_is_scaled_to_the_parameters_size() -> None:
    data = encode_jpeg(np.zeros((720, 1280, 3), np.uint8), CameraParameters(width=320, height=240))
    assert data[:2] == b"\xff\xd8"
    decoded = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    assert decoded is not None
    assert decoded.shape == (240, 320, 3)
