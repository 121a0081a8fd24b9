"""Whether events to try functions with look as the real ones do."""

from __future__ import annotations

import json

import pytest

from gateway.automation.events.kinds import event_kind
from gateway.automation.functions.example_events import AT_NS, EXAMPLE_EVENTS
from gateway.automation.rules.document import read_rule
from gateway.automation.rules.metric_event import metric_event
from gateway.domain.automation.gateway_event import METRIC, TOPIC
from gateway.domain.automation.rule import Maker
from gateway.domain.automation.shapes import eventbridge
from gateway.domain.principal import Role

KINDS = {row.event["detail-type"]: row.event for row in EXAMPLE_EVENTS.values() if "detail-type" in row.event}
JOURNAL = [name for name in KINDS if name.startswith(("metaros.alert", "metaros.robot", "metaros.recording"))]


@pytest.mark.parametrize("name", JOURNAL)
def test_events_of_the_journal_tell_what_its_kind_tells(name: str) -> None:
    reported = {key for key in KINDS[name]["detail"] if key != "robot"}
    assert reported == set(event_kind(name.removeprefix("metaros.")).data)


def test_a_metric_is_reported_as_rules_tell_it() -> None:
    maker = Maker(kind="user", id="u", name="chief", role=Role.ADMIN.word, robots=("*",))
    document = {"name": "battery_low", "metric": {"series": "battery_state.percentage", "below": 0.2}, "targets": []}
    rule = read_rule(document, maker=maker)
    real = metric_event(rule, "sim_1", "battery_state.percentage", AT_NS, 0.18)
    assert KINDS[METRIC] == eventbridge(real)


def test_all_of_them_are_json_and_say_when() -> None:
    assert {TOPIC, METRIC, "metaros.schedule", "metaros.webhook", "order.ready"} <= set(KINDS)
    for row in EXAMPLE_EVENTS.values():
        assert json.loads(json.dumps(row.event)) == row.event
        assert row.meaning
