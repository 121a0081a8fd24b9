"""A value of a series as an event, and the group of a rule that it belongs to."""

from __future__ import annotations

from gateway.automation.rules.rule import Rule
from gateway.domain.automation.gateway_event import METRIC, GatewayEvent
from gateway.domain.automation.shapes import eventbridge
from metaros.automation.rules.when import group_of

__all__ = ["metric_event", "series_group"]


def metric_event(rule: Rule, robot: str, series: str, stamp_ns: int, value: float) -> GatewayEvent:
    """A value that went beyond a rule's bounds."""
    assert rule.metric is not None
    return GatewayEvent(
        id=f"{robot}/{rule.name}/{stamp_ns}",
        type=METRIC,
        source="metaros.metric",
        at_ns=stamp_ns,
        robot=robot,
        data={
            "series": series,
            "value": value,
            "stamp_ns": stamp_ns,
            "above": rule.metric.above,
            "below": rule.metric.below,
            "rule": rule.name,
        },
    )


def series_group(rule: Rule, robot: str, series: str) -> str:
    """The same for all values of a robot's series; a rule over many series keeps them apart, as one over many robots
    does.
    """
    if rule.when is None or rule.metric is None:
        return ""
    group = group_of(rule.when, eventbridge(metric_event(rule, robot, series, 0, 0.0)))
    return f"{group}/{series}"[:256] if "*" in rule.metric.series else group
