"""Feedback "this is normal": which kinds of finding learn from it, and the sentence that says what was learned."""

from __future__ import annotations

from gateway.alerting.anomaly.checks import Check
from gateway.alerting.anomaly.detectors.lasting import OF_VALUE
from gateway.alerting.anomaly.reasons import number
from gateway.domain.finding import Finding

__all__ = ["sentence", "teaches"]

LEARNING_KINDS = ("detector", "frozen", "silence", "rate")


def teaches(check: Check) -> bool:
    """Whether a row of the table learns at all."""
    return check.kind in LEARNING_KINDS


def sentence(finding: Finding, check: Check | None) -> str:
    """What is learnt of a finding."""
    if check is None or not teaches(check):
        return f"{finding.kind} has a fixed bound and learns nothing: change the check, or silence the alert"
    where = f"{finding.series}: " if finding.series else ""
    if finding.kind in OF_VALUE:
        return f"{where}{number(finding.value)} counts as normal"
    words = {
        "vibration": "that it shakes so much counts as normal",
        "calm": "that it moves so little counts as normal",
        "frequency": "that it swings so often counts as normal",
        "together": "these values beside each other count as normal for this robot",
        "cohort": "so far from robots like it is normal for this one",
        "frozen": f"{number(finding.value)} may stay for as long as it has now",
        "silence": "that it is silent for as long as now counts as normal",
    }
    return where + words.get(finding.kind, f"{number(finding.value, 'Hz')} counts as the usual rate")
