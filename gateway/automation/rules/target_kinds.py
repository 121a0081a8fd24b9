"""The table of what rules can do: the fields of each kind of target, and the permission that its rule's maker needs."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any
from urllib.parse import urlsplit

from gateway.automation.rules.errors import RuleInvalidError
from gateway.domain.finding import SEVERITIES
from metaros.errors import NameError_
from metaros.idl.globs import Glob

__all__ = ["SERVICES", "TARGET_KINDS", "Field", "TargetKind", "target_kind"]


@dataclass(frozen=True, slots=True)
class Field:
    """What a field holds: `fits` says whether a value does, `words` what it should be."""

    fits: Callable[[Any], bool]
    words: str
    needed: bool = False


@dataclass(frozen=True, slots=True)
class TargetKind:
    """One row. `permission` is of gateway/identity/permissions.py; `robot`: it is about one robot, the event's own
    where the target names none.
    """

    name: str
    permission: str
    fields: Mapping[str, Field]
    robot: bool = False


def _text(most: int = 1024) -> Callable[[Any], bool]:
    return lambda value: isinstance(value, str) and len(value) <= most and value.isprintable()


def _like(pattern: str) -> Callable[[Any], bool]:
    compiled = re.compile(pattern)
    return lambda value: isinstance(value, str) and compiled.fullmatch(value) is not None


def _url(value: Any) -> bool:
    if not _text(2000)(value) or not value.isascii() or " " in value:
        return False
    try:
        parts = urlsplit(value)
        return bool(parts.scheme in ("http", "https") and parts.hostname and parts.port != 0 and parts.username is None)
    except ValueError:
        return False


def _globs(value: Any) -> bool:
    if not isinstance(value, list) or len(value) > 64:
        return False
    try:
        return all(isinstance(item, str) and Glob(item) for item in value)
    except NameError_:
        return False


def _seconds(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and 0 < value <= 86_400


FUNCTION = r"[A-Za-z0-9_-]{1,64}"
ROBOT = Field(_like(r"[A-Za-z0-9_.-]{0,64}"), "a robot's id; \"\" is the event's")
_QUALIFIER = Field(_like(r"(\$LATEST|[A-Za-z0-9_-]{0,128})"), "a version or an alias")
_REGION = Field(_like(r"[a-z0-9-]{0,32}"), "a region like eu-central-1")

SERVICES: dict[str, dict[str, Field]] = {
    "lambda": {
        "function": Field(_like(r"[A-Za-z0-9_:$.-]{1,256}"), "a function's name or ARN", needed=True),
        "qualifier": _QUALIFIER,
    },
    "sns": {
        "topic_arn": Field(_like(r"arn:[A-Za-z0-9_:./-]{1,300}"), "an SNS topic's ARN", needed=True),
        "subject": Field(_text(100), "at most 100 characters"),
    },
    "sqs": {"queue_url": Field(_url, "an SQS queue's URL", needed=True)},
    "events": {
        "bus": Field(_like(r"[A-Za-z0-9_:./-]{0,300}"), "an event bus' name or ARN"),
        "source": Field(_text(256), "at most 256 characters"),
        "detail_type": Field(_text(128), "at most 128 characters"),
    },
    "s3": {
        "bucket": Field(_like(r"[a-z0-9][a-z0-9.-]{1,61}[a-z0-9]"), "a bucket's name", needed=True),
        "prefix": Field(_text(512), "what its objects' names begin with"),
    },
}

TARGET_KINDS: tuple[TargetKind, ...] = (
    TargetKind(
        "function",
        "functions.invoke",
        {"function": Field(_like(FUNCTION), "a function's name", needed=True), "qualifier": _QUALIFIER},
    ),
    TargetKind("webhook", "rules.write", {"url": Field(_url, "an http(s) URL without a user in it", needed=True)}),
    TargetKind(
        "command",
        "commands.send",
        {"command": Field(_like(r"[a-z_]{1,64}"), "a kind of command", needed=True), "robot": ROBOT},
        robot=True,
    ),
    TargetKind(
        "publish",
        "robots.publish",
        {
            "topic": Field(_like(r"[A-Za-z0-9_/~]{1,256}"), "a topic's name", needed=True),
            "type": Field(_like(r"[A-Za-z0-9_/]{0,256}"), "a type like std_msgs/msg/String"),
            "robot": ROBOT,
            "lease_id": Field(_text(128), "the id of a lease that is held"),
        },
        robot=True,
    ),
    TargetKind(
        "capture",
        "recordings.save",
        {
            "last_s": Field(_seconds, "more than 0 and at most 86400", needed=True),
            "topics": Field(_globs, "a list of at most 64 patterns of topics"),
            "robot": ROBOT,
        },
        robot=True,
    ),
    TargetKind(
        "alert",
        "alerts.handle",
        {
            "severity": Field(lambda value: value in SEVERITIES, f"one of {', '.join(SEVERITIES)}"),
            "reason": Field(_text(500), "at most 500 characters"),
            "for_s": Field(_seconds, "more than 0 and at most 86400"),
            "robot": ROBOT,
        },
        robot=True,
    ),
    TargetKind(
        "aws",
        "rules.write",
        {"service": Field(lambda value: value in SERVICES, f"one of {', '.join(SERVICES)}", needed=True)},
    ),
)
_BY_NAME = {row.name: row for row in TARGET_KINDS}


def target_kind(name: Any, at: str) -> TargetKind:
    """The row of a kind; RuleInvalidError for one that there is none of."""
    found = _BY_NAME.get(name) if isinstance(name, str) else None
    if found is None:
        raise RuleInvalidError(at, f"one of {', '.join(_BY_NAME)}")
    return found
