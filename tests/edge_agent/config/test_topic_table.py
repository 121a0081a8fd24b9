"""The topic table: first match wins, and every row of the default table is what the reference says."""

from __future__ import annotations

import pytest

from edge_agent.config.topic_table import DEFAULT_TOPICS, TopicRule, TopicTable, series_name


@pytest.mark.parametrize(
    ("topic", "delivery", "max_rate_hz", "first_field"),
    [
        ("/sim_1/odom", "auto", 20.0, "pose.pose.position.x"),
        ("/odom", "auto", 20.0, "pose.pose.position.x"),
        ("/sim_1/battery_state", "auto", 2.0, "percentage"),
        ("/sim_1/imu", "auto", 20.0, "angular_velocity.z"),
        ("/sim_1/motor_temperature", "auto", 2.0, "temperature"),
        ("/host/cpu", "auto", 2.0, "percent"),
        ("/sim_1/host/network", "auto", 2.0, "rx_bytes_per_s"),
        ("/sim_1/scan", "auto", 10.0, None),
        ("/sim_1/diagnostics", "auto", 50.0, None),
        ("/diagnostics", "auto", 50.0, None),
        ("/rosout", "event", 0.0, None),
        ("/sim_1/functions/results", "event", 0.0, None),
        ("/sim_1/anything/else", "auto", 10.0, None),
    ],
)
def test_default_table(topic: str, delivery: str, max_rate_hz: float, first_field: str | None) -> None:
    rule = TopicTable().rule(topic)
    assert (rule.delivery, rule.max_rate_hz, rule.forward) == (delivery, max_rate_hz, True)
    assert (rule.fields[0] if rule.fields else None) == first_field
    assert rule.metrics_rate_hz <= 2.0


def test_first_match_wins() -> None:
    table = TopicTable((TopicRule(match="/a/*", delivery="bulk"), *DEFAULT_TOPICS))
    assert table.rule("/a/odom").delivery == "bulk"
    assert table.rule("/b/odom").delivery == "auto"


def test_what_no_row_names_stays_on_the_robot() -> None:
    assert not TopicTable((TopicRule(match="/a"),)).rule("/b").forward


@pytest.mark.parametrize(
    ("topic", "namespace", "name"),
    [
        ("/sim_1/battery_state", "/sim_1", "battery_state.percentage"),
        ("/sim_1/host/cpu", "/sim_1", "host.cpu.percentage"),
        ("/host/cpu", "/", "host.cpu.percentage"),
        ("/rosout", "/sim_1", "rosout.percentage"),
        ("/sim_10/odom", "/sim_1", "sim_10.odom.percentage"),
    ],
)
def test_series_names_are_relative_to_the_namespace(topic: str, namespace: str, name: str) -> None:
    assert series_name(topic, "percentage", namespace=namespace) == name
