"""`function.yaml`: the manifest of a package for the robot that runs it."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import yaml

from metaros.automation.rules.pattern import Pattern, compile_pattern
from metaros.automation.rules.when import When
from metaros.errors import ConfigError, MetarosError
from metaros.idl import names
from metaros.limits import LIMITS, Limits

__all__ = ["FILE", "Retry", "RobotFunction", "Trigger", "parse_function", "read_function"]

FILE: Final = "function.yaml"
MAX_BYTES: Final = 256 * 1024
_NAME: Final = re.compile(r"[a-z0-9](?:[a-z0-9-]{0,61}[a-z0-9])?")  # as of bundles
_HANDLER: Final = re.compile(r"[A-Za-z_][\w./]*\.[A-Za-z_]\w*")
_TYPE: Final = re.compile(r"\w+/msg/\w+")
_KEYS: Final = (
    *("name", "description", "handler", "timeout_s", "memory_mb", "environment", "concurrency", "retry", "triggers"),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Trigger:
    """One topic that is listened to. `type` "" takes the type of its publishers; without `pattern` all count."""

    name: str
    topic: str
    type: str = ""
    pattern: Pattern | None = None
    when: When | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Retry:
    """How often an event is tried, and how old it may be when it is tried for the last time."""

    attempts: int = 3
    max_age_s: float = 86_400.0


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotFunction:
    """A function as its package describes it."""

    name: str
    handler: str
    triggers: tuple[Trigger, ...]
    description: str = ""
    timeout_s: float = 10.0
    memory_mb: int = 128
    concurrency: int = 1
    environment: Mapping[str, str] = field(default_factory=dict)
    retry: Retry = field(default_factory=Retry)


def read_function(folder: Path, *, limits: Limits = LIMITS) -> RobotFunction:
    """The document of an unpacked package. ConfigError names what is wrong in it."""
    path = folder / FILE
    try:
        with path.open("rb") as file:
            text = file.read(MAX_BYTES + 1)
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror or error}") from error
    if len(text) > MAX_BYTES:
        raise ConfigError(f"{FILE} has more than {MAX_BYTES} bytes")
    return parse_function(text, limits=limits)


def parse_function(text: bytes | str, *, limits: Limits = LIMITS) -> RobotFunction:
    """The same from its text."""
    try:
        document = yaml.safe_load(text)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise ConfigError(f"{FILE} is no YAML: {str(error)[:300]}") from error
    table = _table(document, "", _KEYS)
    for key in ("name", "handler", "triggers"):
        if key not in table:
            raise ConfigError(f"{FILE}: {key} is missing")
    return RobotFunction(
        name=_fitting(table["name"], "name", _NAME, "a-z, 0-9 and '-', at most 63"),
        handler=_fitting(table["handler"], "handler", _HANDLER, "a module and a function: app.handler"),
        triggers=_triggers(table["triggers"], limits),
        description=_text(table.get("description", ""), "description", 1000),
        timeout_s=_number(table.get("timeout_s", 10.0), "timeout_s", 0.1, 900.0),
        memory_mb=int(_number(table.get("memory_mb", 128), "memory_mb", 32, 10_240)),
        concurrency=int(_number(table.get("concurrency", 1), "concurrency", 1, 64)),
        environment=_environment(table.get("environment", {}), limits),
        retry=_retry(table.get("retry", {})),
    )


def _triggers(rows: Any, limits: Limits) -> tuple[Trigger, ...]:
    if not isinstance(rows, list) or not 1 <= len(rows) <= limits.robot_triggers:
        raise ConfigError(f"{FILE}: triggers: a list of 1 to {limits.robot_triggers}")
    found: dict[str, Trigger] = {}
    for number, row in enumerate(rows):
        trigger = _trigger(row, number, limits)
        if trigger.name in found:
            raise ConfigError(f"{FILE}: triggers[{number}].name: {trigger.name!r} is there already")
        found[trigger.name] = trigger
    return tuple(found.values())


def _trigger(row: Any, number: int, limits: Limits) -> Trigger:
    where = f"triggers[{number}]"
    table = _table(row, where, ("name", "topic", "type", "pattern", "when"))
    topic = _text(table.get("topic"), f"{where}.topic", limits.ros_name_chars)
    try:
        names.resolve(topic, "/", "node")
    except MetarosError as error:
        raise ConfigError(f"{FILE}: {where}.topic: {error}") from error
    kind = table.get("type", "")
    if kind:
        _fitting(kind, f"{where}.type", _TYPE, "a message type: sensor_msgs/msg/BatteryState")
    try:
        pattern = compile_pattern(table["pattern"]) if "pattern" in table else None
        when = When.parse(table["when"]) if "when" in table else None
    except MetarosError as error:
        raise ConfigError(f"{FILE}: {where}: {error}") from error
    name = _text(table.get("name", topic), f"{where}.name", limits.ros_name_chars)
    return Trigger(name=name, topic=topic, type=kind, pattern=pattern, when=when)


def _retry(value: Any) -> Retry:
    table = _table(value, "retry", ("attempts", "max_age_s"))
    plain = Retry()
    return Retry(
        attempts=int(_number(table.get("attempts", plain.attempts), "retry.attempts", 1, 100)),
        max_age_s=_number(table.get("max_age_s", plain.max_age_s), "retry.max_age_s", 1.0, 30 * 86_400.0),
    )


def _environment(value: Any, limits: Limits) -> dict[str, str]:
    table = _table(value, "environment", None)
    for key, item in table.items():
        if not re.fullmatch(r"[A-Za-z]\w*", key) or not isinstance(item, str) or "\0" in item:
            raise ConfigError(f"{FILE}: environment.{key[:40]}: names and values are texts")
    if sum(len(key.encode()) + len(item.encode()) for key, item in table.items()) > limits.function_environment_bytes:
        raise ConfigError(f"{FILE}: environment: at most {limits.function_environment_bytes} bytes")
    return dict(table)


def _table(value: Any, where: str, known: tuple[str, ...] | None) -> Mapping[str, Any]:
    if not isinstance(value, dict) or not all(isinstance(key, str) for key in value):
        raise ConfigError(f"{FILE}: {where or 'the whole'} is a table of keys and values")
    for key in value if known is not None else ():
        if known is not None and key not in known:
            raise ConfigError(f"{FILE}: {where}{'.' if where else ''}{key[:40]}: known are {', '.join(known)}")
    return value


def _text(value: Any, where: str, most_chars: int) -> str:
    if not isinstance(value, str) or len(value) > most_chars:
        raise ConfigError(f"{FILE}: {where}: a text of at most {most_chars} characters")
    return value


def _fitting(value: Any, where: str, grammar: re.Pattern[str], what: str) -> str:
    if grammar.fullmatch(_text(value, where, 255)) is None:
        raise ConfigError(f"{FILE}: {where}: {what}")
    return str(value)


def _number(value: Any, where: str, least: float, most: float) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not least <= value <= most:
        raise ConfigError(f"{FILE}: {where}: a number from {least:g} to {most:g}")
    return float(value)
