"""The twin's rows over the robot's own."""

from __future__ import annotations

import pytest

from edge_agent.config.topic_table import TopicRule, TopicTable
from edge_agent.twin.topic_table import TwinTopicTable
from metaros.errors import NameError_
from metaros.fleet.twin import parse

OWN = TopicTable(
    [
        TopicRule(match="**/odom", delivery="live", max_rate_hz=20.0, history_hz=2.0, fields=("pose.x",)),
        TopicRule(match="**/plan", delivery="bulk", latest_only=True),
        TopicRule(match="**/secret", seal="features", fields=("a",), delivery="bulk"),
    ]
)


def table(rows: dict[str, dict[str, object]], own: TopicTable = OWN) -> TwinTopicTable:
    return TwinTopicTable(own, parse({"topics": rows}).topics or (), namespace="/r1")


def test_a_row_changes_what_it_gives_and_leaves_the_rest() -> None:
    rule = table({"odom": {"rate_hz": 5.0}}).rule("/r1/odom")
    assert (rule.max_rate_hz, rule.delivery, rule.history_hz, rule.fields) == (5.0, "live", 2.0, ("pose.x",))
    assert table({"odom": {"rate_hz": 5.0}}).rule("/r2/odom").max_rate_hz == 20.0


def test_patterns_are_relative_absolute_or_anywhere() -> None:
    for pattern in ("arm/**", "/r1/arm/*", "**/joint"):
        assert table({pattern: {"rate_hz": 3.0}}).rule("/r1/arm/joint").max_rate_hz == 3.0
    assert TwinTopicTable(OWN, parse({"topics": {"x": {}}}).topics or (), namespace="/").rule("/x").forward


def test_a_topic_that_no_row_of_the_robot_names_is_let_out_by_a_row_of_the_twin() -> None:
    assert not table({}).rule("/r1/new").forward
    assert table({"new": {}}).rule("/r1/new").forward
    assert not table({"new": {"forward": False}}).rule("/r1/new").forward


def test_another_class_takes_what_does_not_go_with_it_away() -> None:
    rule = table({"odom": {"class": "event"}}).rule("/r1/odom")
    assert (rule.delivery, rule.history_hz) == ("event", 0.0)
    rule = table({"plan": {"class": "event"}}).rule("/r1/plan")
    assert (rule.delivery, rule.latest_only) == ("event", False)
    assert table({"odom": {"forward": False}}).rule("/r1/odom").history_hz == 0.0


def test_what_is_sealed_stays_sealed_and_lets_no_more_fields_out() -> None:
    rule = table({"**": {"class": "live", "fields": ["b"], "rate_hz": 1.0}}).rule("/r1/secret")
    assert (rule.seal, rule.fields, rule.max_rate_hz) == ("features", ("a",), 1.0)


def test_a_pattern_that_is_too_long_with_its_namespace_is_refused() -> None:
    rows = parse({"topics": {"a" * 250: {}}}).topics or ()
    with pytest.raises(NameError_):
        TwinTopicTable(OWN, rows, namespace="/" + "n" * 200)
