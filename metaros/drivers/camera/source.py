"""Where images come from: OpenCV for devices, files and streams, and a moving test pattern."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from metaros.drivers.camera.parameters import MAX_PIXELS, CameraParameters
from metaros.errors import UnavailableError

__all__ = ["Image", "Source", "TestPattern", "VideoSource", "open_source"]

Image = npt.NDArray[np.uint8]  # height x width x 3, BGR
OPEN_TIMEOUT_MS = 2500
READ_TIMEOUT_MS = 2500


class Source(Protocol):
    """Something that gives images until it fails."""

    def read(self) -> Image:
        """The next image; UnavailableError when there is none any more."""

    def close(self) -> None:
        """Let the device go."""


class TestPattern:
    """Colour bars, a frame counter in grey-code squares and a moving block: seen to be alive, and to be in order."""

    __test__ = False  # no test case, whatever pytest thinks of the name

    def __init__(self, width: int, height: int) -> None:
        bars = np.array(
            [[255, 255, 255], [0, 255, 255], [255, 255, 0], [0, 255, 0], [255, 0, 255], [0, 0, 255], [255, 0, 0]],
            np.uint8,
        )
        columns = np.arange(width) * len(bars) // width
        self._background: Image = np.broadcast_to(bars[columns] // 2, (height, width, 3)).copy()
        self._count = 0

    def read(self) -> Image:
        """The next image of the pattern."""
        image = self._background.copy()
        height, width = image.shape[:2]
        size = max(4, height // 8)
        left = self._count * size // 4 % max(1, width - size)
        image[height // 2 : height // 2 + size, left : left + size] = 255
        code = self._count ^ (self._count >> 1)
        for bit in range(12):
            start = bit * width // 12
            image[height - size // 2 :, start : start + width // 12] = 255 if code >> bit & 1 else 0
        self._count += 1
        return image

    def close(self) -> None:
        """Nothing to let go."""


class VideoSource:
    """An OpenCV capture of a device number, a file or an address; a file starts again at its end."""

    def __init__(self, name: str, *, width: int, height: int) -> None:
        os.environ.setdefault("OPENCV_LOG_LEVEL", "ERROR")
        import cv2

        self._is_file = not name.isdigit() and "://" not in name
        if self._is_file and not Path(name).is_file():
            raise UnavailableError(f"no video file {name}")
        if name.isdigit():
            self._capture: Any = cv2.VideoCapture(int(name))
            self._capture.set(cv2.CAP_PROP_FRAME_WIDTH, width)
            self._capture.set(cv2.CAP_PROP_FRAME_HEIGHT, height)
        else:
            timeouts = [
                cv2.CAP_PROP_OPEN_TIMEOUT_MSEC,
                OPEN_TIMEOUT_MS,
                cv2.CAP_PROP_READ_TIMEOUT_MSEC,
                READ_TIMEOUT_MS,
            ]
            self._capture = cv2.VideoCapture(name, cv2.CAP_FFMPEG, [] if self._is_file else timeouts)
        if not self._capture.isOpened():
            self._capture.release()
            raise UnavailableError(f"cannot open camera source {name}")
        self._name = name
        pixels = self._capture.get(cv2.CAP_PROP_FRAME_WIDTH) * self._capture.get(cv2.CAP_PROP_FRAME_HEIGHT)
        if pixels > MAX_PIXELS:
            self._capture.release()
            raise UnavailableError(f"{name} has images of {pixels:.0f} pixels, at most {MAX_PIXELS} are read")

    def read(self) -> Image:
        """The next image; waits for the device."""
        import cv2

        good, image = self._capture.read()
        if not good and self._is_file:
            self._capture.set(cv2.CAP_PROP_POS_FRAMES, 0)
            good, image = self._capture.read()
        if not good:
            raise UnavailableError(f"camera source {self._name} ended")
        return np.asarray(image, np.uint8)

    def close(self) -> None:
        """Let the device go."""
        self._capture.release()


def open_source(parameters: CameraParameters) -> Source:
    """The source that the parameters name.

    Raises:
        UnavailableError: it cannot be opened now.
    """
    if parameters.source == "test":
        return TestPattern(parameters.width, parameters.height)
    return VideoSource(parameters.source, width=parameters.width, height=parameters.height)
