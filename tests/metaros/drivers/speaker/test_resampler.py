"""Rates: a tone stays that tone, what the new rate cannot hold is gone, and there is no seam between pieces."""

from __future__ import annotations

import numpy as np
import pytest

from metaros.drivers.speaker.resampler import Resampler
from tests.support.devices.alsa import strongest_hz, tone


def converted(samples: np.ndarray, rate_in: int, rate_out: int, piece: int) -> np.ndarray:
    resampler = Resampler(rate_in, rate_out)
    floats = samples.astype(np.float32) / 32768
    return np.concatenate([resampler.push(floats[at : at + piece]) for at in range(0, len(floats), piece)])


@pytest.mark.parametrize(("rate_in", "rate_out"), [(16000, 48000), (48000, 16000), (44100, 48000), (8000, 44100)])
def test_a_tone_stays_that_tone(rate_in: int, rate_out: int) -> None:
    made = converted(tone(880, 2, rate_in), rate_in, rate_out, 311)
    assert len(made) == pytest.approx(2 * rate_out, abs=rate_out // 50)
    hz, share = strongest_hz((made * 32767).astype(np.int16), rate_out)
    assert abs(hz - 880) < 1
    assert share > 0.9999
    assert np.abs(made[rate_out // 2 :]).max() == pytest.approx(0.5, abs=0.005)


def test_pieces_leave_no_seam() -> None:
    samples = np.random.default_rng(3).integers(-9000, 9000, 4_000, dtype=np.int16)
    whole = converted(samples, 44100, 16000, 4_000)
    for piece in (1, 7, 441):
        assert np.allclose(converted(samples, 44100, 16000, piece), whole, atol=1e-5)


def test_what_the_lower_rate_cannot_hold_is_gone() -> None:
    made = converted(tone(7000, 1, 48000), 48000, 8000, 960)  # would fold to 1 kHz
    assert np.abs(made[400:-400]).max() < 0.005


def test_the_same_rate_is_untouched() -> None:
    samples = np.arange(100, dtype=np.float32)
    assert Resampler(48000, 48000).push(samples) is samples
