"""Reads a rule's document: whatever cannot be is named by its path, and nothing of it is kept."""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Mapping
from typing import Any

import orjson

from gateway.automation.rules.errors import RuleInvalidError
from gateway.automation.rules.rule import MetricSource, Rule, ScheduleSource, Target, TopicSource
from gateway.automation.rules.target_kinds import SERVICES, Field, target_kind
from gateway.automation.rules.transform import KEYS, parse_transform
from gateway.domain.automation.delivery import Policy
from gateway.domain.automation.rule import Maker, StoredRule
from gateway.domain.automation.shapes import SHAPES
from metaros.automation.rules.errors import RuleTextError
from metaros.automation.rules.pattern import Pattern, compile_pattern
from metaros.automation.rules.schedule import Schedule
from metaros.automation.rules.when import When
from metaros.errors import NameError_
from metaros.idl.globs import Glob
from metaros.limits import LIMITS, Limits

__all__ = ["FIELDS", "MISFIRES", "read_rule", "read_stored"]

FIELDS = (
    "name",
    "description",
    "enabled",
    "pattern",
    "until",
    "topic",
    "metric",
    "schedule",
    "when",
    "event_format",
    "targets",
)
MISFIRES = ("skip", "once", "all")
SOURCES = ("topic", "metric", "schedule")
MOST_ATTEMPTS, MOST_AGE_S = 100, 7 * 86_400.0
_NAME = re.compile(r"[a-z0-9][a-z0-9_.-]{0,62}")
_EDGE = {"edge": "rising"}  # of a metric's rule that says nothing: once, when its value goes beyond


def read_stored(stored: StoredRule, *, limits: Limits = LIMITS) -> Rule:
    """A rule of the store. Raises RuleInvalidError where it is of a newer gateway, say."""
    return read_rule(orjson.loads(stored.document), maker=stored.maker, revision=stored.revision, limits=limits)


def read_rule(document: Any, *, maker: Maker, revision: int = 0, limits: Limits = LIMITS) -> Rule:
    """The rule that a document says.

    Raises:
        RuleInvalidError: it cannot be; `path` says where.
    """
    said = _object(document, "", FIELDS)
    try:
        text = orjson.dumps(said, option=orjson.OPT_SORT_KEYS)
    except TypeError as error:  # its reader takes longer numbers and deeper lists than its writer does
        raise RuleInvalidError("", f"a rule is JSON with whole numbers of 64 bits: {error}") from error
    if len(text) > limits.rule_bytes:
        raise RuleInvalidError("", f"a rule has at most {limits.rule_bytes} bytes as JSON, this one {len(text)}")
    _check(said, "name", Field(lambda value: isinstance(value, str) and _NAME.fullmatch(value) is not None, NAME), "")
    _check(said, "description", _DESCRIPTION, "")
    _check(said, "enabled", _BOOL, "")
    sources = [name for name in SOURCES if said.get(name) is not None]
    if len(sources) > 1 or (not sources and said.get("pattern") is None):
        raise RuleInvalidError(
            sources[1] if sources else "pattern", "a rule has a pattern, or one of topic, metric and schedule"
        )
    schedule = _schedule(said.get("schedule"))
    if schedule is not None and any(said.get(name) is not None for name in ("pattern", "until", "when")):
        raise RuleInvalidError("schedule", "a schedule goes without pattern, until and when")
    event_format = said.get("event_format") or "eventbridge"
    if event_format not in SHAPES:
        raise RuleInvalidError("event_format", f"one of {', '.join(SHAPES)}")
    return Rule(
        name=said["name"],
        enabled=said.get("enabled", True),
        pattern=_pattern(said, "pattern", limits),
        until=_until(said, limits),
        topic=_topic(said.get("topic")),
        metric=_metric(said.get("metric")),
        schedule=schedule,
        when=_when(said, limits),
        event_format=event_format,
        targets=_targets(said.get("targets"), limits, maker),
        document=said,
        token=_token(said),
        maker=maker,
        revision=revision,
    )


NAME = "1 to 63 of a-z, 0-9, '_', '.', '-', a letter or digit first"
_DESCRIPTION = Field(lambda value: isinstance(value, str) and len(value) <= 1000 and "\0" not in value, "a text")
_BOOL = Field(lambda value: isinstance(value, bool), "true or false")


def _object(value: Any, at: str, keys: tuple[str, ...]) -> dict[str, Any]:
    if not isinstance(value, Mapping):
        raise RuleInvalidError(at, "an object")
    for key in value:
        if key not in keys:
            raise RuleInvalidError(
                f"{at}.{key}"[:200].lstrip("."), f"there is no such field; there are {', '.join(keys)}"
            )
    return {key: value[key] for key in keys if key in value}


def _check(said: Mapping[str, Any], name: str, field: Field, at: str) -> None:
    if name not in said:
        if field.needed or name == "name":
            raise RuleInvalidError(f"{at}{name}", f"is missing: {field.words}")
    elif not field.fits(said[name]):
        raise RuleInvalidError(f"{at}{name}", field.words)


def _pattern(said: Mapping[str, Any], name: str, limits: Limits) -> Pattern | None:
    if said.get(name) is None:
        return None
    try:
        return compile_pattern(said[name], limits=limits)
    except RuleTextError as error:
        raise _moved(error, name) from error


def _until(said: Mapping[str, Any], limits: Limits) -> Pattern | None:
    if said.get("until") is not None and (said.get("when") is None or said.get("metric") is not None):
        raise RuleInvalidError("until", "it ends what `when` waits for, of a pattern or a topic")
    return _pattern(said, "until", limits)


def _when(said: Mapping[str, Any], limits: Limits) -> When | None:
    wanted = said.get("when")
    if wanted is None and said.get("metric") is not None:
        wanted = _EDGE
    if wanted is None:
        return None
    try:
        return When.parse(wanted, limits=limits)
    except RuleTextError as error:
        raise _moved(error, "when") from error


def _moved(error: RuleTextError, at: str) -> RuleInvalidError:
    """An error of a part, with its path within the rule."""
    path = getattr(error, "path", "")
    return RuleInvalidError(f"{at}.{path}" if path else at, str(error).removeprefix(f"{path}: "))


def _topic(value: Any) -> TopicSource | None:
    if value is None:
        return None
    said = _object(value, "topic", ("topic", "robots"))
    topic = said.get("topic")
    try:
        Glob(topic)  # type: ignore[arg-type]
    except NameError_ as error:
        raise RuleInvalidError("topic.topic", str(error)) from error
    assert isinstance(topic, str)
    return TopicSource(
        topic=topic if topic.startswith(("/", "**")) else f"**/{topic}", robots=_robots(said, "topic.robots")
    )


def _metric(value: Any) -> MetricSource | None:
    if value is None:
        return None
    said = _object(value, "metric", ("series", "robots", "above", "below"))
    series = said.get("series")
    try:
        Glob(series, separator=".")  # type: ignore[arg-type]
    except NameError_ as error:
        raise RuleInvalidError("metric.series", str(error)) from error
    assert isinstance(series, str)
    bounds = {name: said[name] for name in ("above", "below") if said.get(name) is not None}
    for name, bound in bounds.items():
        if not isinstance(bound, int | float) or isinstance(bound, bool) or not math.isfinite(bound):
            raise RuleInvalidError(f"metric.{name}", "a number")
    if not bounds:
        raise RuleInvalidError("metric", "above, or below, or both")
    return MetricSource(series=series, robots=_robots(said, "metric.robots"), **bounds)


def _robots(said: Mapping[str, Any], at: str) -> tuple[str, ...]:
    robots = said.get("robots", ["*"])
    if not isinstance(robots, list) or not 0 < len(robots) <= 64:
        raise RuleInvalidError(at, "a list of 1 to 64 ids and patterns")
    if not all(isinstance(one, str) and 0 < len(one) <= 128 and one.isprintable() for one in robots):
        raise RuleInvalidError(at, "ids and patterns such as lab_*")
    return tuple(robots)


def _schedule(value: Any) -> ScheduleSource | None:
    if value is None:
        return None
    said = _object(value, "schedule", ("expression", "timezone", "misfire"))
    expression, timezone = said.get("expression"), said.get("timezone", "UTC")
    misfire = said.get("misfire", "skip")
    if not isinstance(expression, str) or not isinstance(timezone, str):
        raise RuleInvalidError(
            "schedule.expression", "cron(…), rate(…) or at(…), and timezone a name like Europe/Paris"
        )
    if misfire not in MISFIRES:
        raise RuleInvalidError("schedule.misfire", f"one of {', '.join(MISFIRES)}")
    try:
        schedule = Schedule.parse(expression, timezone)
    except RuleTextError as error:
        raise _moved(error, "schedule") from error
    return ScheduleSource(schedule=schedule, expression=expression, timezone=timezone, misfire=misfire)


def _targets(value: Any, limits: Limits, maker: Maker) -> tuple[Target, ...]:
    if value is None:
        return ()
    if not isinstance(value, list) or len(value) > limits.rule_targets:
        raise RuleInvalidError("targets", f"a list of at most {limits.rule_targets}")
    targets = tuple(_target(item, f"targets[{place}]", maker) for place, item in enumerate(value))
    ids = [target.id for target in targets]
    for place, target_id in enumerate(ids):
        if target_id in ids[:place]:
            raise RuleInvalidError(f"targets[{place}].id", f"two targets are called {target_id}")
    return targets


def _target(value: Any, at: str, maker: Maker) -> Target:
    if not isinstance(value, Mapping):
        raise RuleInvalidError(at, "an object")
    kind = target_kind(value.get("kind"), f"{at}.kind")
    fields = dict(kind.fields)
    if kind.name == "aws" and value.get("service") in SERVICES:
        fields |= {**SERVICES[value["service"]], "region": _REGION}
    said = _object(value, at, ("id", "kind", *fields, *KEYS, "policy"))
    if not isinstance(said.get("id"), str) or _NAME.fullmatch(said["id"]) is None:
        raise RuleInvalidError(f"{at}.id", NAME)
    for name, field in fields.items():
        _check(said, name, field, f"{at}.")
    if (robot := said.get("robot")) and not maker.sees(robot):
        raise RuleInvalidError(f"{at}.robot", "no robot of that id is in your scope")
    return Target(
        id=said["id"],
        kind=kind.name,
        fields={name: said[name] for name in fields if name in said},
        document=said,
        transform=parse_transform(said, at),
        policy=_policy(said.get("policy"), f"{at}.policy"),
    )


_REGION = Field(
    lambda value: isinstance(value, str) and re.fullmatch(r"[a-z0-9-]{0,32}", value) is not None,
    "a region like eu-central-1",
)


def _policy(value: Any, at: str) -> Policy:
    if value is None:
        return Policy()
    said = _object(value, at, ("attempts", "age_s"))
    attempts, age_s = said.get("attempts", Policy().most_attempts), said.get("age_s", Policy().most_age_s)
    if not isinstance(attempts, int) or isinstance(attempts, bool) or not 1 <= attempts <= MOST_ATTEMPTS:
        raise RuleInvalidError(f"{at}.attempts", f"1 to {MOST_ATTEMPTS}")
    if not isinstance(age_s, int | float) or isinstance(age_s, bool) or not 1 <= age_s <= MOST_AGE_S:
        raise RuleInvalidError(f"{at}.age_s", f"1 to {MOST_AGE_S:g}")
    return Policy(most_attempts=attempts, most_age_s=float(age_s))


def _token(said: Mapping[str, Any]) -> str:
    """Of all that gives what a rule remembers its meaning."""
    kept = {name: said.get(name) for name in ("pattern", "until", "topic", "metric", "schedule", "when")}
    return hashlib.blake2b(orjson.dumps(kept, option=orjson.OPT_SORT_KEYS), digest_size=9).hexdigest()
