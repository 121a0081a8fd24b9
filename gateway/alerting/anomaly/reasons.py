"""The sentences that say why something was told: what is, what was expected, in words that need no manual."""

from __future__ import annotations

import math

from gateway.alerting.anomaly.checks import Check
from gateway.alerting.anomaly.detectors.lasting import Change

__all__ = ["changed", "cohort", "fact", "frozen", "limit", "novel", "number", "rate", "silent", "span", "together"]

_SECONDS = ("a second", "8 seconds", "a minute", "9 minutes")


def number(value: float, unit: str = "") -> str:
    """Four digits are enough; a part of one is not made a percentage."""
    text = f"{value:.4g}" if abs(value) < 1e6 else f"{value:.3e}"
    return f"{text} {unit}".strip()


def span(seconds: float) -> str:
    """Seconds as people say them."""
    if not math.isfinite(seconds):
        return "long"
    for size, word in ((86400.0, "d"), (3600.0, "h"), (60.0, "min")):
        if seconds >= 2.0 * size:
            return f"{seconds / size:.0f} {word}"
    return f"{seconds:.0f} s"


def limit(check: Check, value: float) -> str:
    """A threshold or a rate of change was passed."""
    high = check.high is not None and value >= check.high
    bound = check.high if high else check.low
    word = "above" if high else "below"
    held = f" for {span(check.for_s)}" if check.for_s else ""
    return f"{check.title}: {number(value, check.unit)}, {word} {number(bound or 0.0, check.unit)}{held}"


def silent(quiet_s: float, deadline_s: float) -> str:
    """A topic fell silent."""
    return f"Nothing came for {span(quiet_s)} while the robot's other topics go on; usually at most {span(deadline_s)}"


def rate(now_hz: float, usual_hz: float) -> str:
    """A topic is too slow or too fast."""
    return f"{number(now_hz, 'Hz')} instead of the usual {number(usual_hz, 'Hz')}"


def frozen(value: float, run_s: float, allowed_s: float) -> str:
    """A value froze."""
    return f"Exactly {number(value)} for {span(run_s)}, though it keeps coming; usual is {span(allowed_s)}"


def changed(change: Change, value: float, low: float, high: float) -> str:
    """A lasting change. Which words fit depends on the feature."""
    what = change.feature.name.partition(".")[2]
    over = _SECONDS[change.feature.scale]
    band = f"{number(low)} to {number(high)}"
    if what == "mean":
        return f"Mean over {over} is {number(value)}; expected {band}"
    if what == "spread":
        word = "more" if value > high else "less"
        return f"Varies {word} than usual: by {number(value)} within {over}; expected {band}"
    if what == "jump":
        return f"Jumped to {number(value)} within a second and stayed; expected {band}"
    return f"Crosses its mean {number(value)} times in {over}; expected {band}"


def novel(value: float, low: float, high: float) -> str:
    """A value never seen, and it stays."""
    return f"{number(value)} was never seen, and it stays so; seen so far {number(low)} to {number(high)}"


def together(parts: list[tuple[str, float]], times: float) -> str:
    """Metrics that do not fit together, most to blame first."""
    blamed = ", ".join(f"{name} ({part:.0%})" for name, part in parts)
    return f"Metrics do not fit together as usual ({times:.1f} times beyond); most to blame: {blamed}"


def cohort(value: float, median: float, others: int, unit: str = "") -> str:
    """The odd one out; others are not named."""
    return f"This robot {number(value, unit)}, the median of {others} others like it {number(median, unit)}"


def fact(check: Check, where: str, value: float) -> str:
    """Something about a robot that is no metric."""
    of = f" ({where})" if where else ""
    words = {
        "offline": f"Nothing heard of the robot for {span(value)}",
        "behind": f"The newest row is {span(value)} old",
        "ahead": f"The newest row is stamped {span(value)} in the future: the robot's clock is wrong",
        "link_flaps": f"The link came back {value:.0f} times within {span(check.window_s)}",
        "sequence": f"{value:.0f} samples were lost within {span(check.window_s)}{of}",
        "crash_loop": f"The node was started again {value:.0f} times within {span(check.window_s)}{of}",
    }
    return words.get(check.id, f"{check.title}: {number(value, check.unit)}{of}")
