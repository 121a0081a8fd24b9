"""The score of NAB v1.1, written from its rule: what an alarm on a row earns or costs, and the best threshold.

Source of the rule: A. Lavin, S. Ahmad, "Evaluating Real-Time Anomaly Detection Algorithms – the Numenta Anomaly
Benchmark", 2015, and the scorer of numenta/NAB v1.1, whose results the tests reproduce.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields

import numpy as np

from load_tests.anomaly.nab_files import Series

__all__ = [
    "PROFILES",
    "SILENT",
    "Labelled",
    "Profile",
    "Result",
    "joined",
    "label",
    "optimal",
    "result_at",
    "row_weights",
]

SILENT = 1.1  # a threshold that no score reaches


@dataclass(frozen=True, slots=True)
class Profile:
    """What a found window earns, and what a missed one and a false row cost."""

    name: str
    found: float
    missed: float
    false_row: float


PROFILES = (
    Profile("standard", 1.0, 1.0, 0.11),
    Profile("reward_low_FP_rate", 1.0, 1.0, 0.22),
    Profile("reward_low_FN_rate", 1.0, 2.0, 0.11),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """What all series get at one threshold; rows in probation are not counted."""

    threshold: float
    score: float  # 100 = perfect, 0 = silent
    raw: float
    windows: int
    windows_found: int
    rows_in_windows: int
    rows_in_windows_alarmed: int
    rows_outside: int
    rows_outside_alarmed: int

    @property
    def false_per_thousand(self) -> float:
        """False alarms per 1000 rows outside windows."""
        return 1000.0 * self.rows_outside_alarmed / self.rows_outside if self.rows_outside else 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Labelled:
    """A series' rows past probation under one profile: what an alarm on each weighs, and the window it is in."""

    series: Series
    profile: Profile
    weights: np.ndarray
    window: np.ndarray  # index of the row's window, -1 outside

    @property
    def scored(self) -> slice:
        """The rows past probation."""
        return slice(self.series.probation, None)


def row_weights(rows: int, windows: Sequence[tuple[int, int]], profile: Profile) -> np.ndarray:
    """The weight of an alarm on each row: by its place in its window, or after the latest window that ended."""
    index = np.arange(rows, dtype=np.float64)
    weights = np.full(rows, -profile.false_row)
    for first, last in sorted(windows):
        width = last - first + 1
        with np.errstate(divide="ignore"):
            after = (index[last + 1 :] - last) / np.float64(width - 1)
        weights[last + 1 :] = _sigmoid(after) * profile.false_row
    for first, last in windows:
        inside = index[first : last + 1]
        weights[first : last + 1] = _sigmoid(-(last - inside + 1) / (last - first + 1)) * profile.found / _FIRST
    return weights


def _sigmoid(x: np.ndarray) -> np.ndarray:
    return np.where(x > 3.0, -1.0, 2.0 / (1.0 + np.exp(5.0 * np.minimum(x, 3.0))) - 1.0)


_FIRST = float(_sigmoid(np.array([-1.0]))[0])  # of a window's first row


def label(series: Sequence[Series], profile: Profile) -> list[Labelled]:
    """All series with the weights of their rows."""
    made = []
    for one in series:
        window = np.full(len(one.values), -1)
        for number, (first, last) in enumerate(one.windows):
            window[first : last + 1] = number
        weights = row_weights(len(one.values), one.windows, profile)
        made.append(Labelled(series=one, profile=profile, weights=weights, window=window))
    return made


def result_at(labelled: Sequence[Labelled], scores: Sequence[np.ndarray], threshold: float) -> Result:
    """What the scores of all rows get where each row of at least `threshold` alarms."""
    raw, counts = 0.0, np.zeros(6, dtype=int)
    for one, score in zip(labelled, scores, strict=True):
        alarms = score >= threshold
        alarms[: one.series.probation] = False
        earned = [one.weights[first : last + 1][alarms[first : last + 1]] for first, last in one.series.windows]
        raw += sum(max(-one.profile.missed, hits.max(initial=-np.inf)) for hits in earned)
        inside = one.window[one.scored] >= 0
        alarmed = alarms[one.scored]
        raw += float(one.weights[one.scored][alarmed & ~inside].sum())
        found = sum(hits.size > 0 for hits in earned)
        counts += (
            len(earned),
            found,
            inside.sum(),
            (alarmed & inside).sum(),
            (~inside).sum(),
            (alarmed & ~inside).sum(),
        )
    windows, found, in_windows, in_alarmed, outside, outside_alarmed = (int(count) for count in counts)
    return Result(
        threshold=threshold,
        score=_normalised(raw, windows, labelled[0].profile),
        raw=raw,
        windows=windows,
        windows_found=found,
        rows_in_windows=in_windows,
        rows_in_windows_alarmed=in_alarmed,
        rows_outside=outside,
        rows_outside_alarmed=outside_alarmed,
    )


def _normalised(raw: float, windows: int, profile: Profile) -> float:
    silent = -windows * profile.missed
    return 100.0 * (raw - silent) / (windows * profile.found - silent) if windows else 0.0


def joined(results: Sequence[Result], profile: Profile) -> Result:
    """The results of files in groups as one; its threshold is NaN where theirs differ."""
    thresholds = {result.threshold for result in results}
    names = [field.name for field in fields(Result) if field.name not in ("threshold", "score")]
    sums = {name: sum(getattr(result, name) for result in results) for name in names}
    score = _normalised(sums["raw"], sums["windows"], profile)
    return Result(threshold=thresholds.pop() if len(thresholds) == 1 else float("nan"), score=score, **sums)


def optimal(labelled: Sequence[Labelled], scores: Sequence[np.ndarray]) -> Result:
    """The result at the threshold that the labels like best: of equals the highest; it takes the labels to find."""
    pairs = [pair for one, score in zip(labelled, scores, strict=True) for pair in _steps(one, score)]
    levels = np.concatenate([level for level, _ in pairs])
    gains = np.concatenate([gain for _, gain in pairs])
    order = np.argsort(-levels, kind="stable")
    levels, total = levels[order], np.cumsum(gains[order])
    ends = np.flatnonzero(np.append(levels[1:] != levels[:-1], True))  # rows of one score alarm together
    best = ends[int(np.argmax(total[ends]))] if len(ends) else 0
    better = len(ends) and total[best] > 0.0
    return result_at(labelled, scores, float(levels[best]) if better else SILENT)


def _steps(one: Labelled, score: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """What the raw score gains as the threshold sinks below each row's score: of rows outside, then of each window."""
    weights, window, score = one.weights[one.scored], one.window[one.scored], score[one.scored]
    outside = window < 0
    yield score[outside], weights[outside]
    for number in range(len(one.series.windows)):
        inside = window == number
        order = np.argsort(-score[inside], kind="stable")
        best = np.maximum.accumulate(np.append(-one.profile.missed, weights[inside][order]))
        yield score[inside][order], np.diff(best)
