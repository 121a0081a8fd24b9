"""When records are due."""

from __future__ import annotations

import math

import pytest

from metaros.errors import ConfigError
from metaros.record.playback_clock import PlaybackClock


def test_original_speed() -> None:
    pace = PlaybackClock(1.0)
    assert pace.wait_s(100.0, now_s=5.0) == 0.0
    assert pace.wait_s(101.5, now_s=5.5) == 1.0
    assert pace.wait_s(101.5, now_s=9.0) == 0.0


def test_twenty_fold() -> None:
    pace = PlaybackClock(20.0)
    pace.wait_s(0.0, now_s=0.0)
    assert pace.wait_s(60.0, now_s=1.0) == pytest.approx(2.0)


def test_full_speed_never_waits() -> None:
    pace = PlaybackClock(0.0)
    assert [pace.wait_s(stamp, now_s=0.0) for stamp in (0.0, 1.0, 1e9)] == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("rate", [-1.0, math.nan, math.inf])
def test_bad_rates(rate: float) -> None:
    with pytest.raises(ConfigError, match="rate"):
        PlaybackClock(rate)
