"""The robot's own word on what may run on it: `[[allowed]]` and `[nodes]` in the agent's settings.

A signed bundle may always run. Everything else has to be in the robot's own list, by name, or is a free command,
which is off unless the robot's settings turn it on. Nothing remote changes these settings.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from metaros.drivers.registry import manifest_of
from metaros.drivers.values import read_values
from metaros.errors import ConfigError, NameError_
from metaros.idl.globs import Glob
from metaros.limits import LIMITS

__all__ = ["Allowed", "NodeSettings", "allowed_entries", "node_settings"]

MAX_ENTRIES: Final = LIMITS.node_allowed
_NAME: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}\Z")
_DOTTED: Final = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*\Z")
_ROS: Final = re.compile(r"/?[A-Za-z_]\w*(/[A-Za-z_]\w*)*\Z")
_TYPE: Final = re.compile(r"\w+/msg/\w+\Z")
_KINDS: Final = ("command", "module", "class", "driver")
_KEYS: Final = ("name", *_KINDS, "args", "parameters", "fixed", "env", "cwd")


@dataclass(frozen=True, slots=True, kw_only=True)
class Allowed:
    """One `[[allowed]]`: a program that may run under this name. Exactly one of `_KINDS`."""

    name: str
    command: tuple[str, ...] = ()
    module: str = ""
    class_: str = ""
    driver: str = ""  # a kind of metaros.drivers: what it marks as local is never set remotely
    fixed: Mapping[str, Any] = field(default_factory=dict)  # a driver's parameters that this robot sets itself
    args: bool = False  # whether arguments may be added remotely: of some programs they are programs, too
    parameters: bool = True  # whether ROS parameters may
    env: Mapping[str, str] = field(default_factory=dict)
    cwd: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class NodeSettings:
    """The `[nodes]` table, and the list."""

    free_commands: bool = False  # whether whoever may change this robot's twin may run any program here
    health_s: float = 20.0  # a new version of a bundle has to run so long without an exit to be good
    trial_s: float = 180.0  # and to have done so within so long
    allowed: Mapping[str, Allowed] = field(default_factory=dict)
    function_actuators: tuple[str, ...] = ()  # of what moves this robot, the names that its functions may use
    safe_stop: tuple[str, ...] = ()  # a command that brings this robot to rest where a critical node keeps dying
    safe_stop_service: str = ""  # a std_srvs/srv/Trigger that does
    safe_stop_publish: Mapping[str, str] = field(default_factory=dict)  # topics on which the zero message does: types


def node_settings(table: Mapping[str, Any], where: str) -> dict[str, Any]:
    """The [nodes] table as fields of NodeSettings; ConfigError names key and file."""
    values = dict(table)
    for key, value in values.items():
        if key == "free_commands":
            if not isinstance(value, bool):
                raise ConfigError(f"{where}: nodes.{key} must be true or false, not {value!r}")
        elif key in ("health_s", "trial_s"):
            if isinstance(value, bool) or not isinstance(value, int | float) or not 0.1 <= value <= 86_400:
                raise ConfigError(f"{where}: nodes.{key} must be 0.1 to 86400 s, not {value!r}")
        elif key in _READERS:
            values[key] = _READERS[key](value, f"{where}: nodes.{key}")
        else:
            known = ", ".join(("free_commands", "health_s", "trial_s", *_READERS))
            raise ConfigError(f"{where}: unknown key nodes.{key}; known are {known}")
    return values


def _command(value: object, where: str) -> tuple[str, ...]:
    if not isinstance(value, list) or not value or not all(_is_word(word) for word in value) or not value[0]:
        raise ConfigError(f'{where}: expected a program and its arguments: ["/usr/bin/lidar", "--fast"]')
    return tuple(value)


def _service(value: object, where: str) -> str:
    if not isinstance(value, str) or not _ROS.match(value):
        raise ConfigError(f"{where}: expected a service's name, such as base/stop")
    return value


def _topics(value: object, where: str) -> Mapping[str, str]:
    good = isinstance(value, dict) and all(_ROS.match(key) and _is_type(name) for key, name in value.items())
    if not isinstance(value, dict) or not good:
        raise ConfigError(f'{where}: expected types by topics: {{"cmd_vel" = "geometry_msgs/msg/Twist"}}')
    return value


def _globs(value: object, where: str) -> tuple[str, ...]:
    if not isinstance(value, list) or len(value) > MAX_ENTRIES:
        raise ConfigError(f'{where}: expected patterns of names: ["**/gripper/command"]')
    try:
        return tuple(Glob(pattern).pattern for pattern in value)
    except NameError_ as error:
        raise ConfigError(f"{where}: {error}") from error


def _is_type(name: object) -> bool:
    return isinstance(name, str) and _TYPE.match(name) is not None


_READERS: Final = {
    "safe_stop": _command,
    "safe_stop_service": _service,
    "safe_stop_publish": _topics,
    "function_actuators": _globs,
}


def allowed_entries(rows: object, where: str) -> dict[str, Allowed]:
    """The rows of [[allowed]]; ConfigError names row, key and file."""
    if not isinstance(rows, list) or len(rows) > MAX_ENTRIES:
        raise ConfigError(f"{where}: allowed must be [[allowed]] tables, at most {MAX_ENTRIES}")
    found: dict[str, Allowed] = {}
    for number, row in enumerate(rows):
        if not isinstance(row, dict):
            raise ConfigError(f"{where}: allowed[{number}] must be a table")
        entry = _entry(row, f"{where}: allowed[{number}]")
        if entry.name in found:
            raise ConfigError(f"{where}: allowed[{number}]: {entry.name!r} is there already")
        found[entry.name] = entry
    return found


def _entry(row: Mapping[str, Any], where: str) -> Allowed:
    for key in row:
        if key not in _KEYS:
            raise ConfigError(f"{where}: unknown key {key!r}; known are {', '.join(_KEYS)}")
    name = row.get("name")
    if not isinstance(name, str) or not _NAME.match(name):
        raise ConfigError(f"{where}: name: letters, digits, _ . and -, at most 64")
    given = [kind for kind in _KINDS if kind in row]
    if len(given) != 1:
        raise ConfigError(f"{where}: exactly one of {', '.join(_KINDS)} says what may run")
    program = _program(given[0], row[given[0]], where)
    for key in ("args", "parameters"):
        if not isinstance(row.get(key, False), bool):
            raise ConfigError(f"{where}: {key}: true or false: whether they may be set remotely")
    if row.get("args") and given[0] == "driver":
        raise ConfigError(f"{where}: args: a driver takes none: they could name what it opens")
    env, cwd = row.get("env", {}), row.get("cwd", "")
    if not isinstance(env, dict) or not all(_is_variable(key, value) for key, value in env.items()):
        raise ConfigError(f"{where}: env: expected a table of texts")
    if not isinstance(cwd, str) or "\0" in cwd:
        raise ConfigError(f"{where}: cwd: expected a path")
    fixed = _fixed(row.get("fixed", {}), program.get("driver", ""), where)
    return Allowed(
        name=name,
        **program,
        fixed=fixed,
        args=row.get("args", False),
        parameters=row.get("parameters", given[0] != "command"),
        env=env,
        cwd=cwd,
    )


def _fixed(value: object, driver: str, where: str) -> Mapping[str, Any]:
    if not isinstance(value, dict) or (value and not driver):
        raise ConfigError(f'{where}: fixed: expected a table of a driver\'s parameters: {{port = "/dev/ttyUSB0"}}')
    try:
        return read_values(manifest_of(driver), value) if value else {}
    except ConfigError as error:
        raise ConfigError(f"{where}: fixed: {error}") from None


def _program(kind: str, value: object, where: str) -> dict[str, Any]:
    if kind == "command":
        return {"command": _command(value, f"{where}: command")}
    if kind == "driver":
        if not isinstance(value, str):
            raise ConfigError(f"{where}: driver: expected a kind, such as camera")
        try:
            return {"driver": manifest_of(value).kind}
        except ConfigError as error:
            raise ConfigError(f"{where}: driver: {error}") from None
    module, colon, name = value.partition(":") if isinstance(value, str) else ("", "", "")
    if not _DOTTED.match(module) or (kind == "class") != bool(colon) or (colon and not _DOTTED.match(name)):
        raise ConfigError(
            f"{where}: {kind}: expected {'package.module:Class' if kind == 'class' else 'package.module'}"
        )
    return {"module": module} if kind == "module" else {"class_": value}


def _is_word(value: object) -> bool:
    return isinstance(value, str) and "\0" not in value


def _is_variable(key: str, value: object) -> bool:
    return bool(key) and "=" not in key and "\0" not in key and _is_word(value)
