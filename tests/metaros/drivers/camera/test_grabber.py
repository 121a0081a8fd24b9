"""The thread that reads a camera: of pictures that nobody took in time the newest stays."""

from __future__ import annotations

import threading
from typing import Any

import numpy as np
import pytest

from metaros.clock import ManualClock
from metaros.drivers.camera.grabber import Grabber
from metaros.errors import UnavailableError


class Camera:
    """A live one: three pictures, each a period after the other, and then it is gone."""

    paced = False

    def __init__(self, clock: ManualClock) -> None:
        self.closed = threading.Event()
        self._clock = clock
        self._values = iter((1, 2, 3))

    def read(self) -> Any:
        value = next(self._values, None)
        if value is None:
            raise UnavailableError("unplugged")
        self._clock.advance(1.0)
        return np.full((1, 1, 3), value, np.uint8)

    def set_exposure(self, value: float) -> None:
        """It has none."""

    def close(self) -> None:
        self.closed.set()


def test_of_pictures_that_nobody_took_the_newest_stays_and_the_others_are_counted() -> None:
    clock = ManualClock()
    began_ns = clock.wall_ns()
    camera, dropped = Camera(clock), list[int]()
    grabber = Grabber(camera, rate=1.0, clock=clock, dropped=lambda: dropped.append(1))
    assert camera.closed.wait(60)
    picture = grabber.take(0.0)
    assert picture is not None
    assert (int(picture.image[0, 0, 0]), picture.stamp_ns - began_ns) == (3, 3_000_000_000)
    assert len(dropped) == 2
    with pytest.raises(UnavailableError, match="unplugged"):
        grabber.take(0.0)
    grabber.close()
