"""`function.yaml`: what is wrong in it is named."""

from __future__ import annotations

import json
from typing import Any

import pytest

from metaros.automation.robot.manifest import parse_function
from metaros.errors import ConfigError
from tests.support.tables import cases

GOOD = """
name: dock-when-low
handler: app.handler
timeout_s: 20
environment: {LEVEL: "0.2"}
retry: {attempts: 5, max_age_s: 600}
triggers:
  - topic: battery_state
    type: sensor_msgs/msg/BatteryState
    pattern: {detail: {message: {percentage: [{numeric: ["<", 0.2]}]}}}
    when: {edge: rising, cooldown: 10m}
  - {name: words, topic: /sim_1/word}
"""


def test_a_good_one() -> None:
    found = parse_function(GOOD)
    assert (found.name, found.handler, found.timeout_s, found.memory_mb) == ("dock-when-low", "app.handler", 20.0, 128)
    assert (found.retry.attempts, found.retry.max_age_s) == (5, 600.0)
    first, second = found.triggers
    assert (first.name, first.type) == ("battery_state", "sensor_msgs/msg/BatteryState")
    assert first.pattern is not None
    assert first.pattern.matches({"detail": {"message": {"percentage": 0.1}}})
    assert first.when is not None
    assert first.when.edge == "rising"
    assert (second.name, second.topic, second.pattern, second.when) == ("words", "/sim_1/word", None, None)


@cases(
    ("change", "said"),
    [
        ({"name": "Dock Now"}, "name"),
        ({"name": None}, "name"),
        ({"handler": "app"}, "handler"),
        ({"timeout_s": 0}, "timeout_s: a number from 0.1 to 900"),
        ({"memory_mb": True}, "memory_mb"),
        ({"environment": {"A": 1}}, r"environment\.A"),
        ({"environment": {"A": "x" * 5000}}, "environment: at most 4096"),
        ({"retry": {"attempts": 0}}, r"retry\.attempts"),
        ({"retry": {"tries": 3}}, r"retry\.tries: known are attempts"),
        ({"runtime": "python3.11"}, "runtime: known are name"),
        ({"triggers": []}, "triggers: a list of 1 to 64"),
        ({"triggers": [{"topic": "a"}] * 2}, "is there already"),
        ({"triggers": [{"topic": "a b"}]}, r"triggers\[0\]\.topic"),
        ({"triggers": [{"topic": "a", "type": "String"}]}, r"triggers\[0\]\.type"),
        ({"triggers": [{"topic": "a", "pattern": {"detail": 3}}]}, r"triggers\[0\]: detail"),
        ({"triggers": [{"topic": "a", "when": {"for": "soon"}}]}, r"triggers\[0\]: for"),
        ({"triggers": [{"pattern": {}}]}, r"triggers\[0\]\.topic"),
    ],
)
def test_what_is_wrong_is_named(change: dict[str, Any], said: str) -> None:
    document = {"name": "dock", "handler": "app.handler", "triggers": [{"topic": "a"}]} | change
    with pytest.raises(ConfigError, match=said):
        parse_function(json.dumps(document))


@cases("text", ["[1]", "a: [", "", "name: x", "!!python/object:os.system {}"])
def test_what_is_no_document_is_refused(text: str) -> None:
    with pytest.raises(ConfigError):
        parse_function(text)
