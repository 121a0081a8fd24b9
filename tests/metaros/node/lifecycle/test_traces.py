"""Forty random rate traces, arrivals with jitter, a manual clock: health follows the rate and never flaps.

A trace is made of stretches of one true rate each. Flapping is a change that no change of the rate explains: once the
window holds nothing of the stretch before, a change away from the true rate, or, where the true rate lies within the
rule's band, more than one change.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pytest

from metaros.clock import ManualClock
from metaros.node.lifecycle.health import Health, Mode
from metaros.node.lifecycle.health_rules import HealthRule, Step
from metaros.node.lifecycle.meters import RateMeter
from metaros.node.lifecycle.signals import TopicRate

TRACES = 40
SIGNAL = TopicRate("/scan", below_hz=5)
RULE = HealthRule("lidar", SIGNAL, for_s=1.0, clear_for_s=2.0)
STEP_S = 0.1
LATEST_S = 34.0  # window, greatest time to clear, and a little


@dataclass
class Outcome:
    """What one trace came to."""

    steps: list[Step] = field(default_factory=list)
    stretches: int = 0
    flaps: int = 0
    naive: int = 0  # changes of a comparison with the threshold, nothing else
    wrong: int = 0  # long stretches that ended in the wrong mode


def stretches(rng: np.random.Generator) -> list[tuple[float, float]]:
    """(true rate, seconds): anything from silence over the very threshold to 15 Hz, from 0.5 s to a minute."""
    count = int(rng.integers(5, 15))
    rates = rng.choice([0.0, 2.0, 4.8, 5.0, 5.2, 5.5, 10.0, *rng.uniform(0.0, 15.0, 4)], count)
    seconds = np.exp(rng.uniform(np.log(0.5), np.log(60.0), count))
    return [(float(rate), float(length)) for rate, length in zip(rates, seconds, strict=True)]


def wanted(rate_hz: float) -> Mode | None:
    """The mode that belongs to a true rate; None within the band and the jitter beside it."""
    if 4.2 < rate_hz < 7.2:
        return None
    return Mode.DEGRADED if rate_hz < SIGNAL.below_hz else Mode.HEALTHY


def run(seed: int) -> Outcome:
    """Drive meter and rules through one trace."""
    rng, clock, outcome = np.random.default_rng(seed), ManualClock(), Outcome()
    health, meter = Health([RULE], now_s=clock.monotonic_s()), RateMeter(SIGNAL.window_s)
    below = False
    for rate_hz, length_s in stretches(rng):
        begins_s, settled = clock.monotonic_s(), []
        due_s = begins_s + (rng.uniform(0.0, 1.0 / rate_hz) if rate_hz else np.inf)
        while (now_s := clock.monotonic_s()) < begins_s + length_s:
            clock.advance(STEP_S)
            while due_s <= now_s:
                meter.tick(due_s)
                due_s += max(1e-3, (1.0 + rng.normal(0.0, 0.15)) / rate_hz)
            value = meter.rate_hz(now_s)
            outcome.naive += (value < SIGNAL.below_hz) is not below
            below = value < SIGNAL.below_hz
            for decision in health.step(now_s, {SIGNAL.key: value}, active=True):
                outcome.steps.append(decision.step)
                owed_s = SIGNAL.window_s + (RULE.for_s if decision.step is Step.DEGRADE else RULE.clear_for_s)
                if now_s - begins_s > owed_s + STEP_S:
                    settled.append(health.mode)
        mode = wanted(rate_hz)
        outcome.stretches += 1
        outcome.flaps += max(len(settled) - 1, 0) if mode is None else sum(other is not mode for other in settled)
        outcome.wrong += mode is not None and length_s > LATEST_S and health.mode is not mode
    return outcome


@pytest.fixture(scope="module")
def outcomes() -> list[Outcome]:
    """All traces, run once."""
    return [run(seed) for seed in range(TRACES)]


def test_no_trace_flaps(outcomes: list[Outcome]) -> None:
    total = sum(outcome.stretches for outcome in outcomes)
    changes, naive = sum(len(outcome.steps) for outcome in outcomes), sum(outcome.naive for outcome in outcomes)
    flaps = {seed: outcome.flaps for seed, outcome in enumerate(outcomes) if outcome.flaps}
    print(f"{TRACES} traces, {total} stretches: {changes} changes of mode (plain threshold: {naive}), flaps: {flaps}")
    assert flaps == {}
    assert all(len(outcome.steps) <= outcome.stretches for outcome in outcomes)
    assert changes * 3 < naive


def test_modes_alternate_and_follow_the_rate(outcomes: list[Outcome]) -> None:
    for outcome in outcomes:
        assert outcome.steps == [(Step.DEGRADE, Step.RESTORE)[place % 2] for place in range(len(outcome.steps))]
        assert outcome.wrong == 0
    assert sum(bool(outcome.steps) for outcome in outcomes) > TRACES // 2
