"""What a detector would have got on series of a kind that it has never seen: parameters fitted without a category.

Each fold is a whole category of files: files of one category have much in common, so that folds across them (every
fourth file, as it was once) flatter whatever is fitted. For each category the configuration that is best on all others
(standard profile) scores it, at the one threshold; the raw scores of all categories together make the result.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gateway.alerting.anomaly.detectors.stream import Stream
from gateway.alerting.anomaly.parameters import THRESHOLD, BankConfig
from load_tests.anomaly.nab_files import Series
from load_tests.anomaly.nab_scorer import PROFILES, Result, joined, label, result_at

__all__ = ["CANDIDATES", "TUNED", "Fold", "candidates", "cross_validate", "score_all"]

CANDIDATES = 24
# Every parameter that was ever chosen by a score, and what it may be here: half and twice as much.
TUNED: dict[str, tuple[float, ...]] = {
    "limit": (0.165, 0.33, 0.66),
    "spacing": (0.1, 0.2, 0.4),
    "spread_share": (0.05, 0.1, 0.2),
    "window_samples": (6, 12, 24),
    "blocks": (4, 8, 16),
    "raised": (1.0, 2.0, 4.0),
    "raised_samples": (100.0, 200.0, 400.0),
    "cooldown_samples": (12, 24, 48),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Fold:
    """What the other categories chose for this one, and what it got with it under the standard profile."""

    category: str
    config: BankConfig
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


def candidates(count: int = CANDIDATES, *, seed: int = 29) -> Iterator[BankConfig]:
    """Configurations drawn from TUNED, of which the product's own is none: of twenty draws, one near the median."""
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
    for category in sorted({one.category for one in series}):
        inside = [at for at, one in enumerate(series) if one.category == category]
        outside = [at for at, one in enumerate(series) if one.category != category]
        labelled = label([series[at] for at in outside], PROFILES[0])
        fits = [result_at(labelled, [scores[at] for at in outside], THRESHOLD).score for scores in tables]
        best = max(range(len(fits)), key=fits.__getitem__)
        for profile in PROFILES:
            held = label([series[at] for at in inside], profile)
            parts[profile.name].append(result_at(held, [tables[best][at] for at in inside], THRESHOLD))
        scored = parts[PROFILES[0].name][-1]
        folds.append(Fold(category=category, config=configs[best], fitted=fits[best], scored=scored))
    return {profile.name: joined(parts[profile.name], profile) for profile in PROFILES}, folds
