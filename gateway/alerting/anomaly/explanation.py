"""Why a sample got its score, in numbers and in one sentence."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from gateway.alerting.anomaly.parameters import NOVELTIES, THRESHOLD, BankConfig

__all__ = ["Explanation", "Judged", "Learned", "band", "explain", "learned"]

SHORTEST_S = 1e-9  # what is shorter says no rate: that of two samples 1e-313 s apart would be infinite


class Learned(NamedTuple):
    """How far a series' learning is, in samples; it is over when both are equal. `of` is an estimate until then."""

    seen: int
    of: int


class Judged(NamedTuple):
    """A series' last sample as it was judged, before it was learned."""

    value: float
    score: float
    novelty: int  # the value, where that is new; else which was strongest, in the order of NOVELTIES
    x: float  # what that novelty looked at
    nearest: float  # to x, of what it had seen
    reach: float  # how far x could be without an alert
    usual: float  # the value at this hour of the day; NaN where that is new


@dataclass(frozen=True, slots=True, kw_only=True)
class Explanation:
    """A sample's score, and what was expected instead, in the series' own unit.

    `low` and `high` are the band of values around the nearest one seen in which nothing would have been new; for the
    "range" and the "minimum" they hold for those of the last samples.
    """

    score: float
    novelty: str  # one of NOVELTIES; empty where the sample was seen before, or while learning
    value: float
    nearest: float
    low: float
    high: float
    reason: str


def learned(config: BankConfig, *, seen: float, elapsed_s: float) -> Learned:
    """How far a series is: samples and time, both as samples at its own rate."""
    count, left_s = int(seen), max(config.learn_s - elapsed_s, 0.0)
    if count >= config.learn_samples and not left_s:
        return Learned(config.learn_samples, config.learn_samples)
    rate = (count - 1) / elapsed_s if elapsed_s >= SHORTEST_S else 0.0
    more = int(min(left_s * rate, 1e9)) + 1
    return Learned(count, max(config.learn_samples, count + more) if count else config.learn_samples)


def band(kept: Sequence[float], nearest: float, reach: float) -> tuple[float, float]:
    """The values around a kept one in which nothing is new: as far as the kept ones' reaches touch each other."""
    if not kept:
        return 0.0, 0.0
    at = min(bisect_left(kept, nearest), len(kept) - 1)
    if at and abs(kept[at - 1] - nearest) < abs(kept[at] - nearest):
        at -= 1
    first = last = at
    while first and kept[first] - kept[first - 1] <= 2.0 * reach:
        first -= 1
    while last + 1 < len(kept) and kept[last + 1] - kept[last] <= 2.0 * reach:
        last += 1
    return kept[first] - reach, kept[last] + reach


def explain(config: BankConfig, judged: Judged, kept: Sequence[float], progress: Learned) -> Explanation:
    """The last sample's explanation, from what is kept of the novelty that was strongest."""
    value, score, number, x, nearest, reach, usual = judged
    if not kept:
        return Explanation(score=0.0, novelty="", value=0.0, nearest=0.0, low=0.0, high=0.0, reason="no sample yet")
    nearest = nearest if math.isfinite(nearest) else x  # a series' first sample has nothing before it
    offset = usual if NOVELTIES[number] == "profile" else 0.0
    if abs(x - nearest) > reach:  # what was out of the band is kept by now, and is none of it
        kept = [one for one in kept if (one <= nearest if x > nearest else one >= nearest)] or [nearest]
    low, high = (end + offset for end in band(kept, nearest, reach))
    learning = progress.seen < progress.of
    said = f"learning: {progress.seen} of {progress.of} samples" if learning else f"{value:.6g} was seen before"
    made = Explanation(score=score, novelty="", value=value, nearest=nearest + offset, low=low, high=high, reason=said)
    if learning or not score > 0.0:
        return made
    return replace(made, novelty=NOVELTIES[number], reason=_words(config, made, judged))


def _words(config: BankConfig, made: Explanation, judged: Judged) -> str:
    value, score, number, x, nearest, reach, usual = judged
    times = abs(x - nearest) / reach
    new = "is new" if times >= 1.0 else "is nearly new"
    after = "" if times < 1.0 or score >= THRESHOLD else ", soon after an alert"
    far = f"{times:.1f} times as far as it may be"
    ends = f"expected {made.low:.6g} to {made.high:.6g}{after}"
    if NOVELTIES[number] == "profile":
        what = f"{abs(x):.6g} {'over' if x > 0.0 else 'under'} what is usual at this hour, {usual:.6g}"
        return f"the last {config.window_samples} samples, in the mean {what}, {new}: {far} from such seen; {ends}"
    if NOVELTIES[number] == "value":
        return f"{value:.6g} {new}: {far} from the nearest value seen, {nearest:.6g}; {ends}"
    if NOVELTIES[number] == "range":
        what = f"the range of the last {config.window_samples} samples"
    else:
        what = f"the lowest value of the last {config.blocks * config.window_samples} samples"
    return f"{what}, {x:.6g}, {new}: {far} from the nearest such seen, {nearest:.6g}; {ends}"
