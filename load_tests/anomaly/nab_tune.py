"""What a detector would have got had it never seen the files it is scored on: parameters and threshold fitted by fold.

The folds hold whole files, every fourth by name, so that each has files of every category. For each fold the
configuration and the threshold that are best on the other three (standard profile) score it; the raw scores of the four
folds together make the result.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gateway.alerting.anomaly.detectors.stream import Stream
from gateway.alerting.anomaly.parameters import BankConfig
from load_tests.anomaly.nab_files import Series
from load_tests.anomaly.nab_scorer import PROFILES, Result, joined, label, optimal, result_at

__all__ = ["CANDIDATES", "FOLDS", "TUNED", "Fold", "candidates", "cross_validate", "score_all"]

FOLDS = 4
CANDIDATES = 24
# Every parameter that was ever tuned on these files, and what it may be here.
TUNED: dict[str, tuple[float, ...]] = {
    "value_limit": (0.25, 0.35, 0.5),
    "profile_limit": (1.0, 2.0, 4.0),
    "minimum_limit": (0.7, 1.0, 1.5),
    "spacing": (0.1, 0.2),
    "blocks": (4, 8, 12),
    "profile_step": (0.1, 0.3, 0.6),
    "cooldown_samples": (12, 24, 48),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Fold:
    """What the other folds chose for this one, and what it got with it under the standard profile."""

    config: BankConfig
    threshold: float
    fitted: float
    scored: Result


def score_all(series: Sequence[Series], config: BankConfig) -> list[np.ndarray]:
    """The score of each row of each series, each from nothing and in the order of its rows."""
    scores = []
    for one in series:
        stream = Stream(config)
        rows = zip(one.stamps_s.tolist(), one.values.tolist(), strict=True)
        scores.append(np.array([stream.update(stamp_s, value) for stamp_s, value in rows]))
    return scores


def candidates(count: int = CANDIDATES, *, seed: int = 10) -> Iterator[BankConfig]:
    """Configurations drawn from TUNED; the product's own is not among them but by chance."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        drawn: dict[str, Any] = {name: options[rng.integers(len(options))] for name, options in TUNED.items()}
        yield replace(BankConfig(), **drawn)


def cross_validate(
    series: Sequence[Series], configs: Sequence[BankConfig], *, progress: Callable[[int, int], None]
) -> tuple[dict[str, Result], list[Fold]]:
    """The result of each profile over all files, none of which its parameters have seen; and what each fold chose."""
    tables = []
    for number, config in enumerate(configs):
        progress(number, len(configs))
        tables.append(score_all(series, config))
    progress(len(configs), len(configs))
    parts: dict[str, list[Result]] = {profile.name: [] for profile in PROFILES}
    folds = []
    for number in range(FOLDS):
        inside = [at for at in range(len(series)) if at % FOLDS == number]
        outside = [at for at in range(len(series)) if at % FOLDS != number]
        labelled = label([series[at] for at in outside], PROFILES[0])
        fits = [optimal(labelled, [scores[at] for at in outside]) for scores in tables]
        best = max(range(len(fits)), key=lambda one: fits[one].score)
        scores = [tables[best][at] for at in inside]
        for profile in PROFILES:
            held = label([series[at] for at in inside], profile)
            parts[profile.name].append(result_at(held, scores, fits[best].threshold))
        scored = parts[PROFILES[0].name][-1]
        folds.append(Fold(config=configs[best], threshold=fits[best].threshold, fitted=fits[best].score, scored=scored))
    return {profile.name: joined(parts[profile.name], profile) for profile in PROFILES}, folds
