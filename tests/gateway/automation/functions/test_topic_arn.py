"""The names of event sources."""

from __future__ import annotations

import pytest

from gateway.automation.functions.errors import FunctionInvalidError
from gateway.automation.functions.topic_arn import parse_topic_arn


@pytest.mark.parametrize(
    ("arn", "robot", "topic", "fits"),
    [
        ("arn:aws:metaros:::topic/rover-*/battery_state", "rover-1", "/battery_state", True),
        ("arn:aws:metaros:::topic/rover-*/battery_state", "drone-1", "/battery_state", False),
        ("arn:aws:metaros:local:000000000000:topic/*/camera/*/info", "x", "/camera/left/info", True),
        ("arn:aws:metaros:::topic/*/camera/*/info", "x", "/camera/left/raw/info", False),
        ("arn:aws:metaros:::topic/*/camera/**", "x", "/camera/left/raw/info", True),
        ("arn:aws:metaros:::topic/r?/a.b", "r1", "/a.b", False),
    ],
)
def test_globs(arn: str, robot: str, topic: str, fits: bool) -> None:
    try:
        assert parse_topic_arn(arn).matches(robot, topic) is fits
    except FunctionInvalidError:
        assert not fits  # a topic has no dots


@pytest.mark.parametrize(
    "arn",
    ["", "arn:aws:sqs:eu-central-1:123456789012:q", "arn:aws:metaros:::topic/r1", "arn:aws:metaros:::topic/r1//a"],
)
def test_others_are_refused(arn: str) -> None:
    with pytest.raises(FunctionInvalidError, match="EventSourceArn"):
        parse_topic_arn(arn)
