"""Transforms, shapes and documents: the pure parts."""

from __future__ import annotations

import base64
import hashlib
from typing import Any

import orjson
import pytest

from gateway.automation.rules.document import read_rule
from gateway.automation.rules.errors import RuleInvalidError
from gateway.automation.rules.transform import RenderedTooLargeError, parse_transform
from gateway.domain.automation.gateway_event import GatewayEvent
from gateway.domain.automation.rule import Maker
from gateway.domain.automation.shapes import SHAPES, cloudevent, http_v2, kinesis, s3, sqs
from tests.gateway.automation.rules.world import ADMIN, LAB, NOW, rule

EVENT: dict[str, Any] = {"detail": {"robot": 'r"1', "value": 0.5, "list": [{"a b": True}], "none": None}}
STORED = GatewayEvent(
    id="e-7",
    type="metaros.recording.stored",
    source="metaros",
    at_ns=NOW,
    robot="r1",
    data={"recording": "01J", "size_bytes": 5},
)


@pytest.mark.parametrize(
    ("said", "given"),
    [
        ({}, EVENT),
        ({"input": {"fixed": [1]}}, {"fixed": [1]}),
        ({"input_path": "$.detail.value"}, 0.5),
        ({"input_path": '$.detail.list[0]["a b"]'}, True),
        ({"input_path": "$.detail.list[4].x"}, None),
        (
            {
                "transformer": {
                    "paths": {"r": "$.detail.robot", "v": "$.detail.value"},
                    "template": {"t": "<r>: <v>", "v": "<v>"},
                }
            },
            {"t": 'r"1: 0.5', "v": 0.5},
        ),
        ({"transformer": {"template": ["<rule>", "\\<b>", "a <event> b"[:2]]}}, ["one", "<b>", "a "]),
        ({"transformer": {"paths": {"n": "$.detail.none"}, "template": ["<n>", "x<n>y"]}}, [None, "xy"]),
    ],
)
def test_what_a_target_is_given(said: dict[str, Any], given: Any) -> None:
    assert parse_transform(said, "t").render(EVENT, "one", most_bytes=10_000) == given


@pytest.mark.parametrize("template", ["<event>" * 5000, ["<event>"] * 5000])
def test_a_template_that_would_become_gigabytes_does_not(template: Any) -> None:
    """Who made the rule does not know how large events come, and the store's writer would have to make it."""
    transform = parse_transform({"transformer": {"template": template}}, "t")
    found = transform.render({"detail": "x"}, "one", most_bytes=200_000)
    assert len(found) in (5000, 5000 * len('{"detail":"x"}'))
    with pytest.raises(RenderedTooLargeError):
        transform.render({"detail": "x" * 1_000_000}, "one", most_bytes=200_000)


@pytest.mark.parametrize(
    ("said", "path"),
    [
        ({"input": 1, "input_path": "$"}, "t.input_path"),
        ({"input_path": "detail"}, "t.input_path"),
        ({"input_path": "$..x"}, "t.input_path"),
        ({"transformer": {"paths": {}}}, "t.transformer"),
        ({"transformer": {"paths": {"event": "$"}, "template": 1}}, "t.transformer.paths"),
        ({"transformer": {"template": {"a": ["<gone>"]}}}, "t.transformer.template.a[0]"),
    ],
)
def test_what_no_target_can_be_given(said: dict[str, Any], path: str) -> None:
    with pytest.raises(RuleInvalidError) as caught:
        parse_transform(said, "t")
    assert caught.value.path == path


def test_shapes_are_those_of_aws() -> None:
    assert set(SHAPES) == {"eventbridge", "cloudevents", "s3", "sqs", "kinesis", "http-v2"}
    (record,) = s3(STORED)["Records"]
    key = "recordings/r1/01J.mcap"
    etag = hashlib.md5(key.encode(), usedforsecurity=False).hexdigest()  # of the name: its file never changes
    assert (record["eventName"], record["s3"]["object"]) == (
        "ObjectCreated:Put",
        {"key": key, "size": 5, "eTag": etag, "sequencer": f"{NOW:016X}"},
    )
    message = sqs((STORED, STORED))["Records"][1]
    assert (message["messageId"], orjson.loads(message["body"])["id"]) == ("e-7", "e-7")
    item = kinesis((STORED,))["Records"][0]["kinesis"]
    assert orjson.loads(base64.b64decode(item["data"]))["detail"]["recording"] == "01J"
    assert (item["sequenceNumber"], item["partitionKey"]) == ("e-7", "r1")
    assert cloudevent(STORED)["subject"] == "r1"
    hook = GatewayEvent(id="m", type="metaros.webhook", source="x", at_ns=NOW, data={"hook": "git", "body": {"a": 1}})
    assert (http_v2(hook)["rawPath"], http_v2(hook)["body"]) == ("/api/v1/hooks/git", '{"a":1}')


def test_every_field_of_a_rule_is_read() -> None:
    made = read_rule(
        rule(
            topic={"topic": "battery_state", "robots": ["lab_*"]},
            pattern={"detail": {"message": {"percentage": [{"numeric": ["<", 0.2]}]}}},
            until={"detail": {"message": {"percentage": [{"numeric": [">", 0.3]}]}}},
            when={"for": "5s", "cooldown": "10m"},
            event_format="cloudevents",
        ),
        maker=Maker.of(ADMIN),
    )
    assert made.topic is not None
    assert made.topic.topic == "**/battery_state"
    assert made.about("lab_1")
    assert not made.about("hall_1")


@pytest.mark.parametrize(
    ("change", "path"),
    [
        ({"name": "Bad Name"}, "name"),
        ({"topic": {"topic": "a b"}}, "topic.topic"),
        ({"topic": {"topic": "a"}, "metric": {"series": "a", "above": 1}}, "metric"),
        ({"metric": {"series": "a", "above": float("nan")}}, "metric.above"),
        ({"metric": {"series": "a b", "above": 1}}, "metric.series"),
        ({"metric": {"series": None, "above": 1}}, "metric.series"),
        ({"until": {"a": ["b"]}, "pattern": {"a": ["b"]}}, "until"),
        ({"schedule": {"expression": "rate(1 hour)"}, "when": {"for": "1s"}}, "schedule"),
        ({"schedule": {"expression": "rate(1 hour)", "misfire": "never"}}, "schedule.misfire"),
        ({"schedule": {"expression": 5}}, "schedule.expression"),
        ({"schedule": {"expression": "rate(1 hour)", "timezone": None}}, "schedule.expression"),
        ({"targets": "all", "pattern": {"a": ["b"]}}, "targets"),
        ({"description": "x" * 70_000, "pattern": {"a": ["b"]}}, ""),
        ({"pattern": {"a": [2**64]}}, ""),  # no number of the writer of JSON
    ],
)
def test_what_no_rule_can_be(change: dict[str, Any], path: str) -> None:
    with pytest.raises(RuleInvalidError) as caught:
        read_rule({**rule(), **change}, maker=Maker.of(LAB))
    assert caught.value.path == path
