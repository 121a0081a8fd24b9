"""The detectors' score on a folder of NAB-style files: `python -m load_tests.anomaly nab [DIR] [--cross-validate]`.

Without labels in the folder it says how often each series would have alerted, and nothing else can be said. Without a
folder it takes the development series; with `--cross-validate` also without a category at a time, and made-up families.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from gateway.alerting.anomaly.parameters import THRESHOLD, BankConfig
from load_tests.anomaly.families import CHECKING, TUNING, make_series
from load_tests.anomaly.nab_files import FilesError, Series, read_folder
from load_tests.anomaly.nab_scorer import PROFILES, Profile, Result, label, optimal, result_at
from load_tests.anomaly.nab_tune import CANDIDATES, TUNED, Fold, candidates, cross_validate, score_all
from load_tests.anomaly.table import table
from load_tests.anomaly.unseen_families import UNSEEN
from load_tests.figures import note

__all__ = ["PUBLISHED", "main"]

DEVELOPMENT = Path(os.environ.get("METAROS_DATA") or "../shared/data") / "nab_dev"
LEFT_OUT, MADE = "NAB, leave one category out", "made-up series, families never looked at"
MADE_SEED = 16
# Scores that NAB publishes, on the development series: the threshold is the best on their labels, for each profile.
PUBLISHED = (
    ("ARTime", 74.3, 65.3, 79.6),
    ("CAD OSE", 73.4, 70.1, 76.6),
    ("Numenta HTM", 71.1, 65.1, 75.1),
    ("earthgecko Skyline", 61.9, 50.8, 67.1),
    ("range novelty", 60.0, None, None),
    ("Random Cut Forest", 59.2, 43.6, 67.1),
    ("KNN CAD", 58.6, 44.4, 65.3),
    ("windowed Gaussian", 43.5, 25.8, 51.8),
    ("river HalfSpaceTrees", 42.8, None, None),
    ("random", 18.0, 10.8, 28.4),
)


def main(argv: Sequence[str]) -> int:
    """Score the folder; exit code 2 where there is nothing to score."""
    parser = argparse.ArgumentParser(prog="python -m load_tests.anomaly nab", description=__doc__)
    parser.add_argument("folder", nargs="?", type=Path, default=DEVELOPMENT, metavar="DIR")
    parser.add_argument("--cross-validate", action="store_true", help="parameters and threshold fitted anew by fold")
    options = parser.parse_args(argv)
    try:
        series, labelled = read_folder(options.folder)
    except FilesError as error:
        print(error, file=sys.stderr)
        return 2
    started = time.perf_counter()
    scores = score_all(series, BankConfig())
    rows = sum(len(one.values) for one in series)
    each_us = (time.perf_counter() - started) / rows * 1e6
    print(f"{options.folder}: {len(series)} series, {rows:,} rows; {each_us:.1f} µs a row in plain Python\n")
    if not labelled:
        print(table(("Series", "Rows", "Alerts", "per 1000"), _unlabelled(series, scores)))
        return 0
    developed = _same(options.folder, DEVELOPMENT)
    _show(series, scores, developed=developed)
    if options.cross_validate and len({one.category for one in series}) > 1:
        results, folds = cross_validate(series, list(candidates()), progress=_progress)
        _show_folds(results, folds)
        if developed:
            note(LEFT_OUT, [results[PROFILES[0].name].score])
            _show_made()
    return 0


def _show(series: Sequence[Series], scores: Sequence[np.ndarray], *, developed: bool) -> None:
    fixed = {profile.name: result_at(label(series, profile), scores, THRESHOLD) for profile in PROFILES}
    best = {profile.name: optimal(label(series, profile), scores) for profile in PROFILES}
    print(f"ONE parameter set, ONE threshold ({THRESHOLD}), causal, each row scored before it is learned:\n")
    names = ("Profile", "Score", "Windows", "False/1000", "Score at the labels' best threshold")
    print(table(names, [_profile_row(profile, fixed[profile.name], best[profile.name]) for profile in PROFILES]))
    print("\nBy category, standard profile:\n")
    print(table(("Category", "Series", "Score", "Windows", "False/1000"), _categories(series, scores)))
    if not developed:
        return
    print("\nThe parameters were tuned on these very files: the figures above are in-sample.")
    print("So are the peers' thresholds below, one for each profile, and some of them see a file's range in advance:\n")
    ours = ("metaros, fixed threshold", *(fixed[profile.name].score for profile in PROFILES))
    best_of_ours = ("metaros, best thresholds", *(best[profile.name].score for profile in PROFILES))
    rows = sorted((ours, best_of_ours, *PUBLISHED), key=lambda row: -row[1])
    print(table(("Detector", "standard", "low FP", "low FN"), [(row[0], *map(_figure, row[1:])) for row in rows]))


def _profile_row(profile: Profile, fixed: Result, best: Result) -> tuple[str, ...]:
    found = f"{fixed.windows_found} of {fixed.windows}"
    at_best = f"{best.score:.1f} at {best.threshold:.4f}"
    return profile.name, f"{fixed.score:.1f}", found, f"{fixed.false_per_thousand:.2f}", at_best


def _categories(series: Sequence[Series], scores: Sequence[np.ndarray]) -> Iterator[tuple[str, ...]]:
    for category in sorted({one.category for one in series}):
        at = [number for number, one in enumerate(series) if one.category == category]
        result = result_at(label([series[one] for one in at], PROFILES[0]), [scores[one] for one in at], THRESHOLD)
        yield category or "–", str(len(at)), *_category_row(result)


def _category_row(result: Result) -> tuple[str, ...]:
    score = f"{result.score:.1f}" if result.windows else "–"
    return score, f"{result.windows_found} of {result.windows}", f"{result.false_per_thousand:.2f}"


def _unlabelled(series: Sequence[Series], scores: Sequence[np.ndarray]) -> Iterator[tuple[str, ...]]:
    for one, score in zip(series, scores, strict=True):
        alerts = int((score >= THRESHOLD).sum())
        yield one.name, str(len(score)), str(alerts), f"{1000.0 * alerts / max(len(score), 1):.2f}"


def _show_folds(results: dict[str, Result], folds: Sequence[Fold]) -> None:
    print(f"\nLeaving a category out: each is scored with the parameters (of {CANDIDATES} sets, drawn) that are best")
    print(f"on all other categories by the standard profile, at the same threshold ({THRESHOLD}):\n")
    rows = [(name, f"{one.score:.1f}", f"{one.windows_found} of {one.windows}") for name, one in results.items()]
    print(table(("Profile", "Score", "Windows"), rows))
    print()
    names = ("Category", "Score", "on the others", *TUNED)
    print(table(names, [_fold_row(fold) for fold in folds]))


def _fold_row(fold: Fold) -> tuple[str, ...]:
    chosen = (f"{getattr(fold.config, name):g}" for name in TUNED)
    score = f"{fold.scored.score:.1f}" if fold.scored.windows else "–"
    return fold.category, score, f"{fold.fitted:.1f}", *chosen


def _show_made() -> None:
    """The families of made-up series, of a seed that nothing was chosen with."""
    print(f"\nMade-up families, seed {MADE_SEED}: in view when features were chosen, when limits were, and never:\n")
    rows = []
    for kind, families in (("features", TUNING), ("limits", CHECKING), ("never", UNSEEN)):
        made = make_series(families, seed=MADE_SEED)
        scores = score_all(made, BankConfig())
        rows += [(f"{kind}: {name}", *rest) for name, *rest in _categories(made, scores)]
        whole = result_at(label(made, PROFILES[0]), scores, THRESHOLD)
        rows.append((f"{kind}: all", str(len(made)), *_category_row(whole)))
        if families is UNSEEN:
            note(MADE, [whole.score])
    print(table(("Family", "Series", "Score", "Windows", "False/1000"), rows))


def _figure(value: object) -> str:
    return f"{value:.1f}" if isinstance(value, float) else "–"


def _same(folder: Path, other: Path) -> bool:
    return folder.resolve() == other.resolve()


def _progress(done: int, total: int) -> None:
    if sys.stderr.isatty():
        end = "" if done < total else "\r\x1b[K"
        print(f"\rcross-validation: {done} of {total} parameter sets", end=end, file=sys.stderr, flush=True)
