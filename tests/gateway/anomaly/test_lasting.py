"""Level, drift, vibration, calm, frequency and steps: only what lasts is told."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pytest

from gateway.anomaly.lasting import Lasting, LastingConfig
from tests.gateway.anomaly.cellfeed import second

CONFIG = LastingConfig(learn_s=3600, epoch_s=1800)


class Series:
    """One series with noise and a slow swing, fed a second at a time."""

    def __init__(self, config: LastingConfig = CONFIG) -> None:
        self.lasting = Lasting(config)
        self.lasting.grow(1)
        self.rng = np.random.default_rng(11)
        self.at_s = 1000.0

    def usual(self, seconds: int, *, noise: float = 1.0, period_s: float = 300.0) -> list[float]:
        times = self.at_s + np.arange(seconds)
        return (noise * self.rng.normal(size=seconds) + 2.0 * np.sin(times / period_s * 2.0 * np.pi)).tolist()

    def feed(self, values: Iterable[float], *, spread: float = 0.5) -> list[tuple[int, str, bool]]:
        found = []
        for n, value in enumerate(values):
            cell = second(self.at_s, [value], count=10, spread=spread)
            found += [(n, change.kind, change.opened) for change in self.lasting.feed(cell)]
            self.at_s += 1.0
        return found


@pytest.fixture(scope="module")
def learnt() -> Series:
    made = Series()
    assert made.feed(made.usual(7200)) == []
    return made


@pytest.fixture
def series(learnt: Series) -> Series:
    made = Series()
    made.lasting.load(learnt.lasting.dump())
    made.at_s, made.rng = learnt.at_s, np.random.default_rng(12)
    return made


def test_hours_of_the_usual_say_nothing(series: Series) -> None:
    assert series.feed(series.usual(7200)) == []


def test_another_level_is_told_within_five_seconds_and_over_when_it_is_back(series: Series) -> None:
    found = series.feed([value + 15.0 for value in series.usual(60)])
    assert found[0][0] <= 4
    assert found[0][1:] in {("level", True), ("step", True)}
    kinds = {kind for _, kind, opened in series.feed(series.usual(2000)) if not opened}
    assert "level" in kinds


def test_a_spike_of_a_second_or_two_is_not_told(series: Series) -> None:
    assert series.feed([50.0, 50.0, *series.usual(300)]) == []


def test_a_drift_within_the_range_of_seconds_is_told(series: Series) -> None:
    found = series.feed([value + 0.0015 * n for n, value in enumerate(series.usual(2400))])
    assert next(kind for _, kind, opened in found if opened) in {"drift", "level"}


def test_vibration_is_told_by_the_spread_within_seconds(series: Series) -> None:
    assert series.feed(series.usual(20), spread=2.0)[0] == (3, "vibration", True)


def test_vibration_is_told_where_a_second_has_one_row(series: Series) -> None:
    found = series.feed(series.usual(400, noise=5.0))
    assert "vibration" in {kind for _, kind, opened in found if opened}


def test_a_series_that_calms_down_is_told(series: Series) -> None:
    found = series.feed([0.001 * value for value in series.usual(1200)], spread=0.0001)
    assert "calm" in {kind for _, kind, opened in found if opened}


def test_another_frequency_is_told() -> None:
    series = Series()
    series.feed(series.usual(9000, noise=0.05, period_s=64.0))
    found = series.feed(series.usual(900, noise=0.05, period_s=9.0))
    assert "frequency" in {kind for _, kind, opened in found if opened}


def test_a_jump_within_the_range_that_stays_is_a_step() -> None:
    series = Series()
    ramp = 10.0 * np.sin(np.arange(9000) / 2000.0)
    series.feed((ramp + 0.01 * series.rng.normal(size=9000)).tolist())
    found = series.feed([float(ramp[-1]) - 4.0] * 10)
    assert found[0] == (3, "step", True)


def test_gaps_clock_jumps_and_constants_say_nothing(series: Series) -> None:
    for jump_s in (3e8, -3e8, 86_400.0):
        series.at_s += jump_s
        assert series.feed(series.usual(120)) == []
    constant = Series()
    assert constant.feed([1.0] * 9000, spread=0.0) == []


def test_a_snapshot_goes_on_bit_by_bit(series: Series) -> None:
    other = Series()
    other.lasting.load(series.lasting.dump())
    other.at_s = series.at_s
    values = [value + 15.0 for value in series.usual(600)]
    assert other.feed(values) == series.feed(values)
    for name, array in series.lasting.dump()["lasting"].items():
        assert np.array_equal(array, other.lasting.dump()["lasting"][name], equal_nan=True)


def test_an_accepted_level_is_normal(series: Series) -> None:
    series.lasting.accept(0, "level", 20.0)
    assert "level" not in {kind for _, kind, _ in series.feed([value + 15.0 for value in series.usual(60)])}
