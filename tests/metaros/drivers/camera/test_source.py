"""Sources: the test pattern moves, a file repeats, what is not there says so, passwords are not told."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from metaros.drivers.camera.encoders import encode_jpeg, resized
from metaros.drivers.camera.probe import find
from metaros.drivers.camera.source import TestPattern, VideoSource, open_source, redacted, resolve_source
from metaros.errors import ConfigError, UnavailableError


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
    source = open_source("test", width=size[0], height=size[1], rate=10)
    assert source.read().shape == (size[1], size[0], 3)
    source.set_exposure(5)
    source.close()


def test_a_file_plays_and_starts_again(video: Path) -> None:
    source = VideoSource(str(video), width=64, height=48, rate=10)
    means = [round(float(source.read().mean()) / 50) for _ in range(8)]
    source.close()
    assert means == [0, 1, 2, 3, 4, 0, 1, 2]


@pytest.mark.parametrize("name", ["/no/such/file.mp4", "97", "/dev/video97"])
def test_what_is_not_there_is_unavailable(name: str) -> None:
    with pytest.raises(UnavailableError):
        VideoSource(name, width=64, height=48, rate=10)


@pytest.mark.parametrize("data", [b"hello" * 100, bytes(range(256)) * 4096, b""])
def test_a_file_that_is_no_video(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "no.mp4"
    path.write_bytes(data)
    with pytest.raises(UnavailableError, match=r"cannot open|ended"):
        VideoSource(str(path), width=64, height=48, rate=10).read()


def test_half_a_file_plays_what_there_is(tmp_path: Path) -> None:
    path, half = tmp_path / "whole.avi", tmp_path / "half.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 10, (64, 48))
    for value in range(200):
        writer.write(np.full((48, 64, 3), value, np.uint8))
    writer.release()
    data = path.read_bytes()
    half.write_bytes(data[: len(data) // 2])
    source = VideoSource(str(half), width=64, height=48, rate=10)
    for _ in range(20):
        assert source.read().shape == (48, 64, 3)
    source.close()


def test_passwords_are_reported_to_nobody(monkeypatch: pytest.MonkeyPatch) -> None:
    assert redacted("rtsp://user:secret@10.0.0.7:554/stream?token=1#x") == "rtsp://10.0.0.7:554/stream"
    assert redacted("http://[::1") == "http://…"
    assert redacted("/dev/video0") == "/dev/video0"
    monkeypatch.setenv("FRONT", "rtsp://user:secret@10.0.0.7/stream")
    assert resolve_source("env:FRONT") == "rtsp://user:secret@10.0.0.7/stream"
    with pytest.raises(ConfigError, match="NOWHERE is not set"):
        resolve_source("env:NOWHERE")
    with pytest.raises(ConfigError, match="empty"):
        resolve_source("")
    with pytest.raises(UnavailableError) as refused:
        VideoSource("rtsp://user:secret@127.0.0.1:9/x", width=64, height=48, rate=10)
    assert "secret" not in str(refused.value)


def test_jpeg_is_scaled() -> None:
    data = encode_jpeg(resized(np.zeros((720, 1280, 3), np.uint8), 320, 240), 70)
    assert data[:2] == b"\xff\xd8"
    decoded = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    assert decoded is not None
    assert decoded.shape == (240, 320, 3)


def test_probe_lists_first_streams(tmp_path: Path) -> None:
    for number, (index, name) in enumerate([("0", "HD Webcam"), ("1", "HD Webcam"), ("0", "Thermal")]):
        folder = tmp_path / f"video{number}"
        folder.mkdir()
        (folder / "index").write_text(index + "\n")
        (folder / "name").write_text(name + "\n")
    assert [(found.summary, found.parameters["source"]) for found in find(tmp_path)] == [
        ("HD Webcam", "0"),
        ("Thermal", "2"),
    ]
    assert find(tmp_path / "nothing") == []
