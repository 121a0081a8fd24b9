"""The bank of detectors: the same numbers as one series alone, across restarts, and whatever comes in."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gateway.alerting.anomaly.detectors.bank import PAGE_ROWS, THRESHOLD, Bank, BankConfig, SnapshotError
from gateway.alerting.anomaly.detectors.stream import Stream
from gateway.alerting.anomaly.explanation import learned

START_S = 1_767_225_600.0
QUICK = BankConfig(learn_samples=20, learn_s=0.0, profile_learn_s=0.0, cooldown_samples=4, cooldown_s=0.0, places=16)
CONFIGS = (BankConfig(), QUICK, BankConfig(places=8, blocks=3, window_samples=2, learn_s=0.0, memory_samples=200))


def noisy(count: int, *, seed: int = 1) -> np.ndarray:
    """Noise on a daily wave of 5-minute samples, with a spike, a lasting rise and some odd values."""
    rng = np.random.default_rng(seed)
    values = 20.0 + 3.0 * np.sin(np.arange(count) / 288.0 * 2.0 * math.pi) + rng.normal(size=count)
    values[count // 2] += 60.0
    values[3 * count // 4 :] += 15.0
    values[rng.integers(count, size=count // 50)] *= rng.lognormal(sigma=3.0, size=count // 50)
    return values


def run_bank(bank: Bank, slots: list[int], stamps: np.ndarray, columns: list[np.ndarray]) -> np.ndarray:
    """One sample of each slot a call; the scores of each slot as a row."""
    at, rows = np.array(slots), np.array(columns).T
    return np.array([bank.update(at, np.full(len(at), t), row) for t, row in zip(stamps, rows, strict=True)]).T


def run_stream(stream: Stream, stamps: np.ndarray, values: np.ndarray) -> np.ndarray:
    return np.array([stream.update(t, v) for t, v in zip(stamps.tolist(), values.tolist(), strict=True)])


@pytest.mark.parametrize("config", CONFIGS)
def test_many_series_at_once_score_as_each_alone(config: BankConfig) -> None:
    stamps = START_S + np.arange(1100) * 300.0
    columns = [noisy(1100, seed=seed) for seed in range(8)]
    columns[3][:] = 7.0
    columns[4] = np.round(columns[4])
    columns[5][::7] = math.nan
    bank = Bank(config)
    slots = [bank.add(times=1.0 + seed % 3) for seed in range(8)]
    together = run_bank(bank, slots, stamps, columns)
    for seed, slot in enumerate(slots):
        stream = Stream(config, times=1.0 + seed % 3)
        assert (run_stream(stream, stamps, columns[seed]) == together[seed]).all()
        assert stream.explain() == bank.explain(slot)
        assert stream.band() == bank.band(slot)
        assert stream.learned == bank.learned(slot)
        assert stream.ignored == bank.ignored(slot)
    assert (together >= THRESHOLD).sum() > 10


def test_a_snapshot_goes_on_as_if_nothing_had_been() -> None:
    stamps = START_S + np.arange(1000) * 300.0
    columns = [noisy(1000, seed=seed) for seed in range(5)]
    bank = Bank()
    slots = [bank.add(times=1.0 + seed) for seed in range(5)]
    run_bank(bank, slots, stamps[:700], [column[:700] for column in columns])
    other = Bank()
    other.add()
    taken = other.load(bank.dump(slots))
    assert taken == [1, 2, 3, 4, 5]
    rest = [column[700:] for column in columns]
    assert (run_bank(bank, slots, stamps[700:], rest) == run_bank(other, taken, stamps[700:], rest)).all()
    assert bank.dump(slots) == other.dump(taken)
    assert [bank.explain(slot) for slot in slots] == [other.explain(slot) for slot in taken]


def test_a_snapshot_that_does_not_fit_is_refused() -> None:
    bank = Bank()
    slots = [bank.add(), bank.add()]
    data = bank.dump(slots)
    version = bytearray(data)
    version[4] ^= 1
    for bad in (b"", data[:20], data[:-1], data[:40] + b"x" + data[41:], bytes(version)):
        with pytest.raises(SnapshotError):
            bank.load(bad)
    other = Bank(BankConfig(times=2.0))
    with pytest.raises(SnapshotError, match="parameters"):
        other.load(data)
    assert len(other) == 0
    assert SnapshotError.code == "damaged"
    assert bank.load(bank.dump([])) == []


def test_learning_is_reported_and_nothing_alerts_before_it_is_over() -> None:
    bank = Bank()
    slot = np.array([bank.add()])
    assert bank.learned(0) == (0, 150)
    scores, values = [], noisy(700)
    for number in range(700):
        learning = bank.learned(0)
        scores.append(bank.update(slot, START_S + number * np.ones(1), values[number : number + 1])[0])
        if learning.seen < learning.of:
            assert scores[-1] == 0.0
        if number == 300:
            assert bank.learned(0) == (301, 602)  # ten minutes at one a second
            assert bank.explain(0).reason == "learning: 301 of 602 samples"
    assert bank.learned(0) == (150, 150)
    assert max(scores[601:]) > 0.0


def test_an_odd_value_alerts_once_and_is_no_news_again() -> None:
    stream = Stream(QUICK)
    for number in range(200):
        assert stream.update(START_S + number, float(number % 10)) < THRESHOLD
    assert stream.update(START_S + 200, 50.0) >= THRESHOLD
    reported = stream.explain()
    assert (reported.novelty, reported.value, reported.nearest) == ("value", 50.0, 9.0)
    assert reported.low < 0.0 < 9.0 < reported.high < 50.0
    assert reported.reason.startswith("50 is new: ")
    stream.update(START_S + 201, 99.0)
    assert stream.explain().reason.endswith(", soon after an alert")
    for number in range(202, 300):
        assert stream.update(START_S + number, 50.0 if number % 20 == 0 else float(number % 10)) < THRESHOLD


def test_a_series_is_quiet_after_an_alert_for_samples_and_for_time() -> None:
    by_samples, by_time = Stream(QUICK), Stream(dataclasses.replace(QUICK, cooldown_s=30.0))
    for stream in (by_samples, by_time):
        for number in range(200):
            stream.update(START_S + number, float(number % 10))
        scores = [stream.update(START_S + 200 + n, 1e3 * 3.0**n) for n in range(40)]
        alerts = [n for n, score in enumerate(scores) if score >= THRESHOLD]
        assert alerts[0] == 0
        assert min(np.diff(alerts)) == (5 if stream is by_samples else 30)


def test_an_alert_raises_the_limit_for_a_while() -> None:
    def scores_of(wait: int) -> tuple[float, float]:
        stream = Stream(QUICK)
        stamps = iter(np.arange(5000) + START_S)
        for number in range(1000):
            stream.update(next(stamps), float(number % 10))
        first = stream.update(next(stamps), 15.0)
        for number in range(wait):
            stream.update(next(stamps), float(number % 10))
        return first, stream.update(next(stamps), 21.0)  # as far from 15 as 15 was from 9

    (first, soon), (same, late) = scores_of(30), scores_of(2000)
    assert first == same >= THRESHOLD
    assert late / (1.0 - late) > 2.5 * soon / (1.0 - soon)  # three times at once, fading by 200 samples
    assert late == pytest.approx(first, abs=0.02)


def test_a_lasting_rise_inside_the_range_is_the_minimums() -> None:
    rng = np.random.default_rng(1)
    stream = Stream(dataclasses.replace(QUICK, learn_samples=150, raised=0.0))
    for number in range(2000):
        stream.update(START_S + number, float(rng.uniform(0.0, 10.0)))
    risen = ((START_S + number, float(rng.uniform(7.0, 10.0))) for number in range(2000, 2200))
    found = [stream.explain() for sample in risen if stream.update(*sample) >= THRESHOLD]
    reasons = {one.novelty: one.reason for one in found}
    assert set(reasons) == {"range", "minimum"}
    assert "lowest value of the last 96 samples" in reasons["minimum"]
    assert "range of the last 12 samples" in reasons["range"]


def test_a_value_of_another_hour_is_the_profiles() -> None:
    stream = Stream(BankConfig(learn_s=0.0))
    step_s, day = 600.0, 144
    for number in range(8 * day):
        stream.update(START_S + number * step_s, 100.0 * (number % day // 72) + number % 3)
    assert stream.update(START_S + (8 * day + 100) * step_s, 0.0) >= THRESHOLD  # at night it would be nothing
    reported = stream.explain()
    assert reported.novelty == "profile"
    assert "usual at this hour" in reported.reason
    assert reported.low < reported.nearest < reported.high
    assert 80.0 < reported.nearest < 120.0


def test_what_people_call_normal_is_no_news() -> None:
    stream, bank = Stream(QUICK), Bank(QUICK)
    slot = np.array([bank.add()])
    for number in range(200):
        stream.update(START_S + number, float(number % 10))
        bank.update(slot, np.array([START_S + number]), np.array([float(number % 10)]))
    for taught in (stream.accept, lambda value: bank.accept(0, value)):
        taught(50.0)
        taught(50.0)
        taught(math.nan)
    assert stream.update(START_S + 300, 50.0) < THRESHOLD
    assert bank.update(slot, np.array([START_S + 300]), np.array([50.0]))[0] < THRESHOLD
    assert stream.explain() == bank.explain(0)


def test_a_full_list_keeps_its_span_and_settles() -> None:
    rng = np.random.default_rng(3)
    config = dataclasses.replace(QUICK, places=64)
    stream = Stream(config)
    values = rng.standard_cauchy(size=20_000)
    scores = np.array([stream.update(START_S + n, v) for n, v in enumerate(values.tolist())])
    kept = stream._novelties[0].kept
    assert len(kept) == config.places - 2
    assert kept == sorted(kept)
    assert kept[0] <= np.sort(values)[5]  # far values stay, near ones become one
    assert kept[-1] >= np.sort(values)[-5]
    assert (scores[10_000:] >= THRESHOLD).sum() < 30  # it does not fire for ever


def test_slots_are_used_again_and_nothing_of_the_old_series_stays() -> None:
    bank = Bank(QUICK)
    slots = [bank.add() for _ in range(PAGE_ROWS + 3)]
    assert slots == list(range(PAGE_ROWS + 3))
    assert bank.size_bytes < 2 * PAGE_ROWS * 4096
    values = np.arange(len(slots), dtype=float)
    for number in range(30):
        bank.update(np.array(slots), np.full(len(slots), START_S + number), values)
    bank.free(7)
    assert len(bank) == PAGE_ROWS + 2
    with pytest.raises(KeyError, match="slot 7"):
        bank.explain(7)
    assert bank.add() == 7
    assert bank.learned(7) == (0, QUICK.learn_samples)
    assert bank.band(7) == (0.0, 0.0)
    assert bank.explain(7).reason == "no sample yet"
    assert bank.explain(8).value == 8.0
    assert bank.update(np.array([], dtype=np.int64), np.array([]), np.array([])).size == 0
    for wrong in (0.0, 5e-324, 1e6, math.nan):  # a limit of 0 would make every score a NaN
        with pytest.raises(ValueError, match="times"):
            bank.add(times=wrong)


def test_a_series_takes_less_than_nine_kib_in_all_its_life() -> None:
    bank = Bank()
    slot = np.array([bank.add()])
    assert bank.size_bytes / PAGE_ROWS < 9 * 1024
    before = bank.size_bytes
    rng = np.random.default_rng(2)
    for number in range(500):
        bank.update(slot, np.array([START_S + number]), rng.lognormal(sigma=5.0, size=1))
    assert bank.size_bytes == before


def test_parameters_that_cannot_be() -> None:
    for wrong in ({"places": 100}, {"places": 4}, {"times": 0.0}, {"blocks": 1}, {"spacing": -1.0}):
        with pytest.raises(ValueError, match=next(iter(wrong))):
            BankConfig(**wrong)


HOSTILE_VALUES = st.one_of(st.floats(), st.sampled_from([0.0, -0.0, 1.0, 5e-324, 1e308, -1e308, 1e-310]))
HOSTILE_STAMPS = st.one_of(
    st.floats(), st.floats(1.7e9, 1.8e9), st.sampled_from([START_S, START_S + 3.2e8, -1e-20, 0.0])
)


HOSTILE = BankConfig(learn_samples=3, learn_s=0.0, profile_learn_s=0.0, places=8, window_samples=2, blocks=2, bins=4)


def test_samples_no_time_apart_say_no_rate() -> None:
    """Found by hypothesis: one sample in 2.2e-313 s is a rate for which there is no number."""
    for span_s in (5e-324, 2.2e-313, 1e-20):
        assert learned(HOSTILE, seen=2.0, elapsed_s=span_s) == (2, 3)
        assert learned(BankConfig(), seen=2.0, elapsed_s=span_s) == (2, 150)
        bank, stream = Bank(HOSTILE), Stream(HOSTILE)
        slot = np.array([bank.add()])
        for stamp_s in (0.0, span_s):
            assert bank.update(slot, np.array([stamp_s]), np.ones(1))[0] == stream.update(stamp_s, 1.0) == 0.0
        assert bank.explain(0).reason == stream.explain().reason == "learning: 2 of 3 samples"


def test_a_step_beyond_all_numbers_is_a_day() -> None:
    config = dataclasses.replace(HOSTILE, learn_samples=4, learn_s=HOSTILE.longest_step_s)
    bank, stream = Bank(config), Stream(config)
    slot = np.array([bank.add()])
    for stamp_s in (0.0, -1.7e308, 1.7e308, 1.7e308):
        bank.update(slot, np.array([stamp_s]), np.ones(1))
        stream.update(stamp_s, 1.0)
    assert bank.learned(0) == stream.learned == (4, 4)


@settings(max_examples=50)
@given(st.lists(st.tuples(HOSTILE_STAMPS, HOSTILE_VALUES), min_size=1, max_size=120))
def test_whatever_comes_the_score_is_a_score(samples: list[tuple[float, float]]) -> None:
    bank, stream = Bank(HOSTILE), Stream(HOSTILE)
    slot = np.array([bank.add()])
    for stamp_s, value in samples:
        score = bank.update(slot, np.array([stamp_s]), np.array([value]))[0]
        assert 0.0 <= score <= 1.0
        assert stream.update(stamp_s, value) == score
        reported = bank.explain(0)
        numbers = (reported.value, reported.nearest, reported.low, reported.high, *bank.band(0))
        assert all(map(math.isfinite, numbers))
    assert bank.explain(0) == stream.explain()
    assert bank.dump([0]) == bank.dump([0])


def test_clock_jumps_and_gaps_of_years_are_no_storm() -> None:
    stream, rng = Stream(), np.random.default_rng(5)
    stamps = START_S + np.arange(6000) * 1.0
    stamps[2000:] += 10 * 365 * 86_400.0  # ten years of gap
    stamps[3000:] -= 12 * 365 * 86_400.0  # and back
    stamps[4000:4500] = stamps[4000]  # a clock that stands
    stamps[5000:] = rng.permutation(stamps[5000:])
    scores = run_stream(stream, stamps, rng.normal(size=6000))
    assert (scores >= THRESHOLD).sum() <= 8


@pytest.mark.parametrize("period", [12, 77, 288])
def test_rounding_errors_of_a_series_that_only_repeats_are_no_news(period: int) -> None:
    stream = Stream()
    for number in range(12 * 288):
        value = 0.1 + 0.7 * (number % period > period // 3)
        assert stream.update(START_S + number * 300.0 + number % 3, value) < THRESHOLD


def test_a_constant_series_is_quiet_until_it_changes() -> None:
    stream = Stream()
    scores = [stream.update(START_S + number * 10.0, 12.0) for number in range(500)]
    assert scores == [0.0] * 500
    assert stream.update(START_S + 5000.0, 12.001) < THRESHOLD  # within a thousandth of its size
    assert stream.update(START_S + 5010.0, 13.0) >= THRESHOLD
