"""The thread that reads a source independently of encoding; only the newest picture is kept."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Final, NamedTuple

from metaros.clock import Clock
from metaros.drivers.camera.source import Image, Source
from metaros.errors import UnavailableError

__all__ = ["Grabber", "Picture"]

JOIN_S: Final = 2.5  # longer than a stream's read timeout


class Picture(NamedTuple):
    """An image and when it was read."""

    image: Image
    stamp_ns: int


class Grabber:
    """Reads `rate` pictures a second at most; a live source is read on in between: its buffers hold nothing old."""

    def __init__(self, source: Source, *, rate: float, clock: Clock, dropped: Callable[[], object]) -> None:
        self.exposure: float | None = None  # to be set before the next picture
        self._source = source
        self._period_s = 1.0 / rate
        self._clock = clock
        self._dropped = dropped
        self._condition = threading.Condition()
        self._newest: Picture | None = None
        self._error: UnavailableError | None = None
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="camera", daemon=True)
        self._thread.start()

    def take(self, timeout_s: float) -> Picture | None:
        """The newest picture, None when none came in time. Raises UnavailableError: the source has failed."""
        with self._condition:
            if self._newest is None and self._error is None:
                self._condition.wait(timeout_s)
            picture, self._newest = self._newest, None
            if picture is None and self._error is not None:
                raise self._error
            return picture

    def close(self) -> None:
        """Stop reading; the thread lets the source go, at the latest when its read has timed out."""
        self._over.set()
        self._thread.join(JOIN_S)

    def _run(self) -> None:
        try:
            self._read()
        except UnavailableError as error:
            self._fail(error)
        except Exception as error:  # OpenCV's and FFmpeg's own
            self._fail(UnavailableError(f"{type(error).__name__}: {error}"))
        finally:
            self._source.close()

    def _read(self) -> None:
        due_s = self._clock.monotonic_s()
        while not self._over.is_set():
            if self.exposure is not None:
                value, self.exposure = self.exposure, None
                self._source.set_exposure(value)
            if self._source.paced and self._over.wait(max(0.0, due_s - self._clock.monotonic_s())):
                return
            image = self._source.read()
            stamp_ns, now_s = self._clock.wall_ns(), self._clock.monotonic_s()
            if not self._source.paced and now_s + self._period_s / 4 < due_s:
                continue  # a camera faster than asked
            due_s = max(due_s + self._period_s, now_s)
            with self._condition:
                if self._newest is not None:
                    self._dropped()
                self._newest = Picture(image, stamp_ns)
                self._condition.notify()

    def _fail(self, error: UnavailableError) -> None:
        with self._condition:
            self._error = error
            self._condition.notify()
