"""The ladder: down at once, up slowly; key frames are given as asked, but not faster than allowed."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from metaros.drivers.camera.ladder import KEY_EVERY_S, UP_AFTER_S, KeyFrames, Ladder


def test_down_at_once_up_one_rung_after_a_while() -> None:
    ladder = Ladder(1280, 720, 2_000_000)
    assert (ladder.rung.width, ladder.rung.height, ladder.rung.bitrate_bps) == (1280, 720, 2_000_000)
    low = ladder.carry(400_000, 0.0)
    assert low.bitrate_bps == 360_000
    assert (low.width, low.height) == (640, 360)
    assert ladder.carry(0, 1.0) == low
    assert ladder.carry(0, 1.0 + UP_AFTER_S - 0.1) == low
    higher = ladder.carry(0, 1.0 + UP_AFTER_S)
    assert higher == ladder.rungs[ladder.rungs.index(low) - 1]
    assert ladder.carry(0, 1.1 + UP_AFTER_S) == higher


def test_a_moment_of_less_begins_the_wait_anew() -> None:
    ladder = Ladder(1280, 720, 2_000_000)
    low = ladder.carry(400_000, 0.0)
    ladder.carry(0, 1.0)
    ladder.carry(400_000, 2.0)
    assert ladder.carry(0, 1.5 + UP_AFTER_S) == low


@given(st.integers(16, 7680), st.integers(16, 7680), st.integers(50_000, 50_000_000), st.integers(0, 2**32 - 1))
def test_every_rung_can_be_encoded(width: int, height: int, bitrate: int, budget: int) -> None:
    ladder = Ladder(width, height, bitrate)
    rung = ladder.carry(budget, 0.0)
    assert rung in ladder.rungs
    for each in ladder.rungs:
        assert each.width % 2 == each.height % 2 == 0
        assert min(each.width, each.height) >= 16
        assert each.bitrate_bps >= 50_000
    if budget >= ladder.rungs[-1].bitrate_bps:
        assert rung.bitrate_bps <= max(budget, 50_000)


def test_key_frames_are_given_once_and_not_too_often() -> None:
    keys = KeyFrames()
    assert not keys.due(0.0)
    keys.ask()
    keys.ask()
    assert keys.due(1.0)
    assert not keys.due(1.0)
    keys.ask()
    assert not keys.due(1.0 + KEY_EVERY_S / 2)
    assert keys.due(1.0 + KEY_EVERY_S)
