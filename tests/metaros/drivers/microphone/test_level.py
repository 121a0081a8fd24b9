"""Levels in dB of full scale."""

from __future__ import annotations

import numpy as np
import pytest

from metaros.drivers.microphone.level import SILENCE_DB, LevelMeter
from tests.support.devices.alsa import tone


def level(samples: np.ndarray) -> float:
    meter = LevelMeter()
    reported = [meter.add(samples[at : at + 320]) for at in range(0, 3200, 320)]
    assert reported[:-1] == [None] * 9
    assert reported[-1] is not None
    return reported[-1]


def test_levels() -> None:
    assert level(np.zeros(3200, np.int16)) == SILENCE_DB
    assert level(np.full(3200, -32768, np.int16)) == pytest.approx(0.0)
    assert level(tone(400, 0.2, 16000, level=1.0)) == pytest.approx(-3.01, abs=0.01)
    assert level(np.ones(3200, np.int16)) == pytest.approx(-90.3, abs=0.1)
