"""Where pictures come from: OpenCV for devices, files and streams, and a moving test pattern."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any, Final, Protocol
from urllib.parse import urlsplit, urlunsplit

import numpy as np
import numpy.typing as npt

from metaros.errors import ConfigError, UnavailableError

__all__ = ["MAX_PIXELS", "Image", "Source", "TestPattern", "VideoSource", "open_source", "redacted", "resolve_source"]

Image = npt.NDArray[np.uint8]  # height x width x 3, BGR
MAX_PIXELS: Final = 40_000_000
OPEN_TIMEOUT_MS: Final = 2000
READ_TIMEOUT_MS: Final = 2000
_ENVIRONMENT: Final = "env:"


class Source(Protocol):
    """Something that gives pictures until it fails."""

    paced: bool  # it gives pictures as fast as they are read

    def read(self) -> Image:
        """The next picture; UnavailableError when there is none any more."""

    def set_exposure(self, value: float) -> None:
        """A device's exposure; 0 is automatic. Other sources have none."""

    def close(self) -> None:
        """Let the device go."""


class TestPattern:
    """Colour bars, a frame counter in Gray-code squares and a moving block: seen to be alive, and to be in order."""

    __test__ = False  # no test case, whatever pytest thinks of the name
    paced = True

    def __init__(self, width: int, height: int) -> None:
        bars = np.array(
            [[255, 255, 255], [0, 255, 255], [255, 255, 0], [0, 255, 0], [255, 0, 255], [0, 0, 255], [255, 0, 0]],
            np.uint8,
        )
        columns = np.arange(width) * len(bars) // width
        self._background: Image = np.broadcast_to(bars[columns] // 2, (height, width, 3)).copy()
        self._count = 0

    def read(self) -> Image:
        """The next picture of the pattern."""
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

    def set_exposure(self, value: float) -> None:
        """It has none."""

    def close(self) -> None:
        """Nothing to let go."""


class VideoSource:
    """An OpenCV capture of a device, a file or an address; a file starts again at its end."""

    def __init__(self, name: str, *, width: int, height: int, rate: float) -> None:
        """Raises UnavailableError: it cannot be opened now."""
        os.environ.setdefault("OPENCV_LOG_LEVEL", "ERROR")
        os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")  # FFmpeg's own words about broken streams
        import cv2

        self._name = name
        self._device = _is_device(name)
        self.paced = not self._device and "://" not in name
        if self.paced and not Path(name).is_file():
            raise UnavailableError(f"no video file {name}")
        self._capture: Any = self._opened(cv2, width, height, rate)
        if not self._capture.isOpened():
            self._capture.release()
            raise UnavailableError(f"cannot open {redacted(name)}")
        pixels = self._capture.get(cv2.CAP_PROP_FRAME_WIDTH) * self._capture.get(cv2.CAP_PROP_FRAME_HEIGHT)
        if pixels > MAX_PIXELS:
            self._capture.release()
            raise UnavailableError(
                f"{redacted(name)} has pictures of {pixels:.0f} pixels, at most {MAX_PIXELS} are read"
            )

    def _opened(self, cv2: Any, width: int, height: int, rate: float) -> Any:
        if not self._device:
            timeouts = [
                cv2.CAP_PROP_OPEN_TIMEOUT_MSEC,
                OPEN_TIMEOUT_MS,
                cv2.CAP_PROP_READ_TIMEOUT_MSEC,
                READ_TIMEOUT_MS,
            ]
            return cv2.VideoCapture(self._name, cv2.CAP_FFMPEG, [] if self.paced else timeouts)
        backends = {"linux": cv2.CAP_V4L2, "darwin": cv2.CAP_AVFOUNDATION, "win32": cv2.CAP_DSHOW}
        number: Any = int(self._name) if self._name.isdigit() else self._name
        capture = cv2.VideoCapture(number, backends.get(sys.platform, cv2.CAP_ANY))
        capture.set(cv2.CAP_PROP_FOURCC, cv2.VideoWriter.fourcc(*"MJPG"))  # raw pictures of 720p fill a USB 2 bus
        capture.set(cv2.CAP_PROP_FRAME_WIDTH, width)
        capture.set(cv2.CAP_PROP_FRAME_HEIGHT, height)
        capture.set(cv2.CAP_PROP_FPS, rate)
        capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)
        return capture

    def read(self) -> Image:
        """The next picture; waits for the device, a stream at most READ_TIMEOUT_MS."""
        import cv2

        try:
            good, image = self._capture.read()
            if not good and self.paced:
                self._capture.set(cv2.CAP_PROP_POS_FRAMES, 0)
                good, image = self._capture.read()
        except cv2.error as error:
            raise UnavailableError(f"{redacted(self._name)}: {error}") from None
        if not good or image is None or image.size == 0:
            raise UnavailableError(f"{redacted(self._name)} ended")
        if image.shape[0] * image.shape[1] > MAX_PIXELS:
            raise UnavailableError(f"{redacted(self._name)} has pictures of more than {MAX_PIXELS} pixels")
        return np.asarray(image, np.uint8)

    def set_exposure(self, value: float) -> None:
        """Of a device alone; V4L2 calls manual 1 and automatic 3, the others 0.25 and 0.75."""
        import cv2

        if not self._device:
            return
        manual, automatic = (1.0, 3.0) if sys.platform == "linux" else (0.25, 0.75)
        self._capture.set(cv2.CAP_PROP_AUTO_EXPOSURE, manual if value else automatic)
        if value:
            self._capture.set(cv2.CAP_PROP_EXPOSURE, value)

    def close(self) -> None:
        """Let the device go."""
        self._capture.release()


def open_source(name: str, *, width: int, height: int, rate: float) -> Source:
    """The source of that name, resolved; UnavailableError where it cannot be opened now."""
    if name == "test":
        return TestPattern(width, height)
    return VideoSource(name, width=width, height=height, rate=rate)


def resolve_source(text: str) -> str:
    """`env:NAME` as the variable has it; ConfigError where that, or the text, is empty."""
    name = text
    if text.startswith(_ENVIRONMENT):
        name = os.environ.get(text.removeprefix(_ENVIRONMENT), "")
        if not name:
            raise ConfigError(f"camera: the environment variable {text.removeprefix(_ENVIRONMENT)} is not set")
    if not name:
        raise ConfigError("camera: source is empty; give a device number, a file, an address or `test`")
    return name


def redacted(name: str) -> str:
    """The source as it may be read by everybody: without name and password, query and fragment."""
    if "://" not in name:
        return name
    try:
        parts = urlsplit(name)
        place = (parts.hostname or "") + (f":{parts.port}" if parts.port else "")
    except ValueError:
        return name.partition("://")[0] + "://…"
    return urlunsplit((parts.scheme, place, parts.path, "", ""))


def _is_device(name: str) -> bool:
    return name.isdigit() or name.startswith("/dev/")
