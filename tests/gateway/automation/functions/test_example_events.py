"""Whether events to try functions with look as the real ones do."""

from __future__ import annotations

import json

import pytest

from gateway.domain.happening import METRIC, TOPIC
from gateway.domain.principal import Role
from gateway.domain.rule import Maker
from gateway.domain.shapes import eventbridge
from gateway.events.kinds import event_kind
from gateway.rules.document import read_rule
from gateway.rules.metric_happening import metric_happening
from gateway.sample_events import AT_NS, SAMPLE_EVENTS

KINDS = {row.event["detail-type"]: row.event for row in SAMPLE_EVENTS.values() if "detail-type" in row.event}
JOURNAL = [name for name in KINDS if name.startswith(("metaros.alert", "metaros.robot", "metaros.recording"))]


@pytest.mark.parametrize("name", JOURNAL)
def test_events_of_the_journal_tell_what_its_kind_tells(name: str) -> None:
    told = {key for key in KINDS[name]["detail"] if key != "robot"}
    assert told == set(event_kind(name.removeprefix("metaros.")).data)


def test_a_metric_is_told_as_rules_tell_it() -> None:
    maker = Maker(kind="user", id="u", name="chief", role=Role.ADMIN.word, robots=("*",))
    document = {"name": "battery_low", "metric": {"series": "battery_state.percentage", "below": 0.2}, "targets": []}
    rule = read_rule(document, maker=maker)
    real = metric_happening(rule, "sim_1", "battery_state.percentage", AT_NS, 0.18)
    assert KINDS[METRIC] == eventbridge(real)


def test_all_of_them_are_json_and_say_when() -> None:
    assert {TOPIC, METRIC, "metaros.schedule", "metaros.webhook", "order.ready"} <= set(KINDS)
    for row in SAMPLE_EVENTS.values():
        assert json.loads(json.dumps(row.event)) == row.event
        assert row.meaning
