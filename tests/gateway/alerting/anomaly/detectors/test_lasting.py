"""Level, drift, vibration, calm, frequency and steps: only what lasts is told."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
import numpy.typing as npt
import pytest

from gateway.alerting.anomaly.detectors.lasting import Lasting, LastingConfig
from tests.gateway.alerting.anomaly.cellfeed import quick, second

Values = npt.NDArray[np.float64]
CONFIG = quick(LastingConfig(learn_s=3600, epoch_s=1800))
LEARNT_S = 2250
USUAL, OTHER_USUAL, CONSTANT, WAVE, RAMP = range(5)
BEGIN_S = 1000.0


def usual(rng: np.random.Generator, at_s: float, seconds: int, *, noise: float = 1.0, period_s: float = 75.0) -> Values:
    """Noise and a slow swing."""
    times = at_s + np.arange(seconds)
    values: Values = noise * rng.normal(size=seconds) + 2.0 * np.sin(times / period_s * 2.0 * np.pi)
    return values


class Series:
    """One of the series that were learnt, fed on a second at a time."""

    def __init__(self, learnt: Lasting, slot: int) -> None:
        self.lasting, self.slot = Lasting(CONFIG), slot
        self.lasting.load(learnt.dump())
        self.rng, self.at_s = np.random.default_rng(12), BEGIN_S + LEARNT_S

    def usual(self, seconds: int, *, noise: float = 1.0, period_s: float = 75.0) -> list[float]:
        return usual(self.rng, self.at_s, seconds, noise=noise, period_s=period_s).tolist()

    def told(self, values: Iterable[float], *, spread: float = 0.5) -> Iterator[tuple[int, str, bool]]:
        """Feeds on as long as somebody reads."""
        for n, value in enumerate(values):
            cell = second(self.at_s, [value], slots=[self.slot], count=10, spread=spread)
            self.at_s += 1.0
            for change in self.lasting.feed(cell):
                yield n, change.kind, change.opened

    def feed(self, values: Iterable[float], *, spread: float = 0.5) -> list[tuple[int, str, bool]]:
        return list(self.told(values, spread=spread))


@pytest.fixture(scope="module")
def learnt() -> Lasting:
    """All series at once, two and a half times as long as learning takes; of the usual ones nothing is told."""
    lasting = Lasting(CONFIG)
    lasting.grow(5)
    rng, ramp = np.random.default_rng(11), 10.0 * np.sin(np.arange(LEARNT_S) / 500.0)
    columns = (
        usual(rng, BEGIN_S, LEARNT_S),
        usual(rng, BEGIN_S, LEARNT_S, noise=2.0, period_s=225.0),
        np.ones(LEARNT_S),
        usual(rng, BEGIN_S, LEARNT_S, noise=0.05, period_s=16.0),
        ramp + 0.01 * rng.normal(size=LEARNT_S),
    )
    spread = (0.5, 0.5, 0.0, 0.5, 0.5)
    told = []
    for n, values in enumerate(np.stack(columns, axis=1)):
        told += lasting.feed(second(BEGIN_S + n, values, count=10, spread=spread))
    assert [change for change in told if change.slot in (USUAL, OTHER_USUAL, CONSTANT)] == []
    return lasting


@pytest.fixture
def series(learnt: Lasting) -> Series:
    return Series(learnt, USUAL)


def test_hours_of_the_usual_say_nothing(series: Series) -> None:
    """As in `learnt`, where two series and a constant are judged for half an hour."""
    assert series.feed(series.usual(500)) == []


def test_another_level_is_reported_within_five_seconds_and_over_when_it_is_back(series: Series) -> None:
    found = series.feed([value + 15.0 for value in series.usual(60)])
    assert found[0][0] <= 4
    assert found[0][1:] in {("level", True), ("step", True)}
    assert any(kind == "level" and not opened for _, kind, opened in series.told(series.usual(500)))


def test_a_spike_of_a_second_or_two_is_not_reported(series: Series) -> None:
    assert series.feed([50.0, 50.0, *series.usual(300)]) == []


def test_a_drift_within_the_range_of_seconds_is_reported(series: Series) -> None:
    told = series.told(value + 0.0015 * n for n, value in enumerate(series.usual(2400)))
    assert next(kind for _, kind, opened in told if opened) in {"drift", "level"}


def test_vibration_is_reported_by_the_spread_within_seconds(series: Series) -> None:
    assert series.feed(series.usual(20), spread=2.0)[0] == (3, "vibration", True)


def test_vibration_is_reported_where_a_second_has_one_row(series: Series) -> None:
    assert ("vibration", True) in (edge[1:] for edge in series.told(series.usual(400, noise=5.0)))


def test_a_series_that_calms_down_is_reported(series: Series) -> None:
    told = series.told([0.001 * value for value in series.usual(1200)], spread=0.0001)
    assert ("calm", True) in (edge[1:] for edge in told)


def test_another_frequency_is_reported(learnt: Lasting) -> None:
    series = Series(learnt, WAVE)
    told = series.told(series.usual(900, noise=0.05, period_s=9.0))
    assert ("frequency", True) in (edge[1:] for edge in told)


def test_a_jump_within_the_range_that_stays_is_a_step(learnt: Lasting) -> None:
    last = 10.0 * np.sin((LEARNT_S - 1) / 500.0)
    assert Series(learnt, RAMP).feed([float(last) - 4.0] * 10)[0] == (3, "step", True)


def test_gaps_and_clock_jumps_say_nothing(series: Series) -> None:
    for jump_s in (3e8, -3e8, 86_400.0):
        series.at_s += jump_s
        assert series.feed(series.usual(120)) == []


def test_a_snapshot_goes_on_bit_by_bit(series: Series) -> None:
    other = Series(series.lasting, USUAL)
    values = [value + 15.0 for value in series.usual(200)]
    assert other.feed(values) == series.feed(values)
    for name, array in series.lasting.dump()["lasting"].items():
        assert np.array_equal(array, other.lasting.dump()["lasting"][name], equal_nan=True)


def test_an_accepted_level_is_normal(series: Series) -> None:
    series.lasting.accept(0, "level", 20.0)
    assert "level" not in {kind for _, kind, _ in series.feed([value + 15.0 for value in series.usual(60)])}
