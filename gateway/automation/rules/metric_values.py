"""Values of series against the bounds of rules: by columns, so that what is as it should be costs next to nothing."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from gateway.automation.rules.evaluation import Evaluation
from gateway.automation.rules.metric_event import metric_event
from gateway.automation.rules.rule import Rule
from gateway.automation.rules.ruleset import Ruleset
from gateway.domain.automation.shapes import eventbridge
from gateway.domain.sample import Rows
from metaros.automation.rules.when import When

__all__ = ["evaluate_rows", "evaluate_values"]

Stamps = npt.NDArray[np.int64]
Values = npt.NDArray[np.float64]


def evaluate_rows(evaluation: Evaluation, ruleset: Ruleset, robot: str, rows: Rows) -> None:
    """Every rule that is about one of the series of a batch looks at its values."""
    for number, series in enumerate(rows.series):
        watching = ruleset.of_series(robot, series.name)
        if not watching:
            continue
        place = np.flatnonzero(rows.index == number)
        if not len(place):
            continue
        stamps, values = rows.stamps[place], rows.values[place]
        low, high = float(values.min()), float(values.max())
        for rule, group in watching:
            if not (_within(rule, low, high) and evaluation.rests(rule, group)):
                evaluate_values(evaluation, rule, group, robot, series.name, stamps, values)


def evaluate_values(
    evaluation: Evaluation, rule: Rule, group: str, robot: str, series: str, stamps: Stamps, values: Values
) -> None:
    """One rule looks at values of one series of a robot, the oldest first."""
    try:
        _judge(evaluation, rule, group, robot, series, stamps, values)
    except Exception as error:  # whatever somebody put into a rule
        evaluation.failed(rule, error)


def _within(rule: Rule, low: float, high: float) -> bool:
    """Whether values between two bounds are all as they should be; nobody knows where one is no number."""
    source, when = rule.metric, rule.when
    assert source is not None
    if when is None or when.hysteresis is not None or low != low:
        return False
    return not ((source.above is not None and high > source.above) or (source.below is not None and low < source.below))


def _judge(
    evaluation: Evaluation, rule: Rule, group: str, robot: str, series: str, stamps: Stamps, values: Values
) -> None:
    when, source = rule.when, rule.metric
    assert when is not None
    assert source is not None
    beyond = np.zeros(len(values), bool)
    if source.above is not None:
        beyond |= values > source.above
    if source.below is not None:
        beyond |= values < source.below
    if rule.pattern is not None:
        for place in np.flatnonzero(beyond).tolist():
            gateway_event = metric_event(rule, robot, series, int(stamps[place]), float(values[place]))
            beyond[place] = rule.pattern.matches(eventbridge(gateway_event))
    if not beyond.any() and when.hysteresis is None and not evaluation.of(rule, group).row.state:
        return  # as it should be, and was
    evaluation.counts(rule).matched += int(beyond.sum())
    for place in _steps(when, beyond):
        value = float(values[place])
        gateway_event = metric_event(rule, robot, series, int(stamps[place]), value)
        matched = bool(beyond[place]) or when.hysteresis is not None
        evaluation.step(rule, when, group, gateway_event, matched, value)


def _steps(when: When, beyond: npt.NDArray[np.bool_]) -> Iterator[int]:
    """The values that a condition has to see: where it looks at edges alone, those where something begins or ends."""
    if when.edge is None or when.hysteresis is not None or when.absent_for_ns is not None:
        yield from range(len(beyond))
        return
    yield 0
    yield from (int(place) + 1 for place in np.flatnonzero(beyond[1:] != beyond[:-1]))
