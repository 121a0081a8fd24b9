"""Launch tables: a TOML file that names a robot's nodes and how each is kept running. Pure but for reading the file.

Errors name the file, the table and the key, and say what would be right.
"""

from __future__ import annotations

import difflib
import math
import re
import shlex
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import Any, Final

from metaros.errors import ConfigError
from metaros.supervise.restart_policy import Restart, RestartPolicy

__all__ = ["NODE_KEYS", "RESTART_KEYS", "TABLE_KEYS", "LaunchTable", "NodeRow", "parse_table", "read_table"]

MAX_BYTES: Final = 1024 * 1024
MAX_NODES: Final = 256
_NAME: Final = re.compile(r"[A-Za-z_][A-Za-z0-9_]*\Z")
_DOTTED: Final = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*\Z")
_KINDS: Final = ("module", "class", "driver", "ros2", "command")
_DRIVER: Final = re.compile(r"[a-z][a-z0-9_]*\Z")

TABLE_KEYS: Final = ("node", "safe_stop", "safe_stop_service", "env", "log_bytes", "heartbeat_s", "spare")
NODE_KEYS: Final = (
    "name",
    *_KINDS,
    "args",
    "namespace",
    "rename",
    "parameters",
    "remap",
    "env",
    "nice",
    "critical",
    "restart",
    "after",
    "rest_for_one",
    "heartbeat",
    "stop_grace_s",
)
RESTART_KEYS: Final = ("when", "base_delay_s", "max_delay_s", "healthy_after_s", "window_s", "exits", "quarantine_s")
_POLICY_FIELDS: Final = {"when": "restart", "exits": "window_exits"}


@dataclass(frozen=True, slots=True, kw_only=True)
class NodeRow:
    """One `[[node]]`: exactly one of `module`, `class_`, `driver`, `ros2` and `command` says what it is."""

    name: str
    module: str = ""
    class_: str = ""
    driver: str = ""  # a kind of `metaros driver list`
    ros2: str = ""  # a program written for ROS 2: a file, a module, or a package and its executable
    command: tuple[str, ...] = ()
    args: tuple[str, ...] = ()
    namespace: str = ""
    rename: bool = True  # the node takes the row's name; off for a module that makes several nodes
    parameters: Mapping[str, Any] = field(default_factory=dict)
    parameter_file: Path | None = None
    remap: Mapping[str, str] = field(default_factory=dict)
    env: Mapping[str, str] = field(default_factory=dict)
    nice: int = 0
    policy: RestartPolicy = field(default_factory=RestartPolicy)
    after: tuple[str, ...] = ()
    rest_for_one: bool = False
    heartbeat: bool = True
    stop_grace_s: float = 5.0

    @property
    def what(self) -> str:
        """What it runs, in one word or line."""
        return self.module or self.class_ or self.driver or self.ros2 or " ".join(self.command)


@dataclass(frozen=True, slots=True, kw_only=True)
class LaunchTable:
    """The whole file, checked; `nodes` are in an order in which they can be started."""

    path: Path
    nodes: tuple[NodeRow, ...]
    safe_stop: tuple[str, ...] = ()
    safe_stop_service: str = ""
    env: Mapping[str, str] = field(default_factory=dict)
    log_bytes: int = 4 * 1024 * 1024
    heartbeat_s: float = 2.0
    spare: bool = True

    @property
    def folder(self) -> Path:
        """Where relative paths of the table begin, and its nodes run."""
        return self.path.parent


def read_table(path: Path) -> LaunchTable:
    """Read and check a launch table; ConfigError says what is wrong with it, and where."""
    try:
        with path.open("rb") as file:
            data = file.read(MAX_BYTES + 1)
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror}") from None
    if len(data) > MAX_BYTES:
        raise ConfigError(f"{path}: a launch table has at most {MAX_BYTES} bytes")
    try:
        return parse_table(data.decode(), path.absolute())
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path}: not UTF-8 at byte {error.start}") from None


def parse_table(text: str, path: Path) -> LaunchTable:
    """The same for the text of such a file."""
    try:
        tree = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise ConfigError(f"{path.name}: no TOML: {error}") from None
    top = _Keys(tree, path.name, TABLE_KEYS)
    rows = top.value("node", list, [])
    if not rows:
        raise ConfigError(f"{path.name}: no [[node]] in it: a launch table needs at least one")
    if len(rows) > MAX_NODES:
        raise ConfigError(f"{path.name}: {len(rows)} nodes; at most {MAX_NODES} are taken")
    nodes = [_node(row, path, number) for number, row in enumerate(rows, 1)]
    return LaunchTable(
        path=path,
        nodes=_ordered(nodes, path.name),
        safe_stop=top.texts("safe_stop"),
        safe_stop_service=top.value("safe_stop_service", str, ""),
        env=top.environment("env"),
        log_bytes=int(top.number("log_bytes", 4 * 1024 * 1024, low=4096, high=2**40, whole=True)),
        heartbeat_s=top.number("heartbeat_s", 2.0, low=0.05, high=3600.0),
        spare=top.value("spare", bool, True),
    )


class _Keys:
    """One table of the file: its values by key, each checked; `where` begins every error."""

    def __init__(self, table: object, where: str, known: Sequence[str]) -> None:
        if not isinstance(table, dict):
            raise ConfigError(f"{where}: expected a table, not {_kind(table)}")
        self.where = where
        self._table: dict[str, Any] = table
        for key in table:
            if key not in known:
                near = difflib.get_close_matches(key, known, n=1, cutoff=0.6)
                hint = f"did you mean {near[0]!r}?" if near else f"there are: {', '.join(known)}"
                raise ConfigError(f"{where}: unknown key {key!r}; {hint}")

    def __contains__(self, key: str) -> bool:
        return key in self._table

    def fail(self, key: str, text: str) -> ConfigError:
        return ConfigError(f"{self.where}: {key}: {text}")

    def value(self, key: str, kind: type[Any], default: Any) -> Any:
        found = self._table.get(key, default)
        if not isinstance(found, kind) or (kind is int and isinstance(found, bool)):
            raise self.fail(key, f"expected {_NAMES[kind]}, not {_kind(found)}")
        return found

    def number(self, key: str, default: float, *, low: float, high: float, whole: bool = False) -> float:
        found = self._table.get(key, default)
        if isinstance(found, bool) or not isinstance(found, int if whole else (int, float)):
            raise self.fail(key, f"expected a {'whole ' if whole else ''}number, not {_kind(found)}")
        if not (math.isfinite(found) and low <= found <= high):
            raise self.fail(key, f"{found} is not within {low:g} to {high:g}")
        return float(found)

    def texts(self, key: str) -> tuple[str, ...]:
        found = self.value(key, list, [])
        for item in found:
            if not isinstance(item, str) or "\0" in item:
                raise self.fail(key, f"expected a list of texts, found {_kind(item)} in it")
        return tuple(found)

    def environment(self, key: str) -> dict[str, str]:
        found = self.value(key, dict, {})
        for name, value in found.items():
            if not isinstance(value, str) or not name or "=" in name or "\0" in name + value:
                raise self.fail(key, f"{name!r}: expected a text without NUL")
        return dict(found)


_NAMES: Final = {str: "a text", list: "a list", dict: "a table", bool: "true or false", int: "a whole number"}


def _kind(value: object) -> str:
    for kind in (bool, str, list, dict, int):
        if isinstance(value, kind):
            return _NAMES[kind]
    return "a number" if isinstance(value, float) else type(value).__name__


def _node(table: object, path: Path, number: int) -> NodeRow:
    name = table.get("name") if isinstance(table, dict) else None
    keys = _Keys(table, f"{path.name}: [[node]] {f'{name!r}' if isinstance(name, str) else number}", NODE_KEYS)
    if not isinstance(name, str) or not _NAME.match(name) or len(name) > 64:
        raise keys.fail("name", "every node needs one: a letter or _, then letters, digits and _, at most 64")
    parameters, file = _parameters(keys, path.parent)
    restart = keys._table.get("restart", {})
    kinds = _what(keys)
    row = NodeRow(
        name=name,
        **kinds,
        args=keys.texts("args"),
        namespace=_namespace(keys),
        rename=keys.value("rename", bool, True),
        parameters=parameters,
        parameter_file=file,
        remap=_remap(keys),
        env=keys.environment("env"),
        nice=int(keys.number("nice", 0, low=-20, high=19, whole=True)),
        policy=_policy(keys, restart),
        after=keys.texts("after"),
        rest_for_one=keys.value("rest_for_one", bool, False),
        heartbeat=keys.value("heartbeat", bool, True),
        stop_grace_s=keys.number("stop_grace_s", 5.0, low=0.0, high=600.0),
    )
    if row.rest_for_one and not row.after:
        raise keys.fail("rest_for_one", "it needs `after`: the nodes with which it is restarted")
    return row


def _what(keys: _Keys) -> dict[str, Any]:
    given = [kind for kind in _KINDS if kind in keys]
    if len(given) != 1:
        found = " and ".join(given) if given else "none"
        raise ConfigError(f"{keys.where}: exactly one of {', '.join(_KINDS)} says what to run; found {found}")
    kind = given[0]
    if kind == "command":
        command = keys.texts(kind)
        if not command or not command[0]:
            raise keys.fail(kind, 'expected a program and its arguments: ["ros2", "run", "pkg", "node"]')
        return {"command": command}
    text = keys.value(kind, str, "")
    if kind == "ros2":
        if not _is_program(text):
            raise keys.fail(kind, f"{text!r} does not look like talker.py, package.module or `package executable`")
        return {"ros2": text}
    if kind == "driver":
        if not _DRIVER.match(text):
            raise keys.fail(kind, f"{text!r} does not look like camera; `metaros driver list` shows the kinds")
        return {"driver": text}
    module, colon, name = text.partition(":")
    if not _DOTTED.match(module) or (kind == "class") != bool(colon) or (colon and not _DOTTED.match(name)):
        shape = "package.module:Class" if kind == "class" else "package.module"
        raise keys.fail(kind, f"{text!r} does not look like {shape}")
    return {"module": module} if kind == "module" else {"class_": text}


def _is_program(text: str) -> bool:
    """One word, or two: a path may have blanks in it between quotes."""
    try:
        return len(shlex.split(text)) in (1, 2) and "\0" not in text
    except ValueError:
        return False


def _namespace(keys: _Keys) -> str:
    text: str = keys.value("namespace", str, "")
    if text and not all(_NAME.match(part) for part in text.strip("/").split("/") if text.strip("/")):
        raise keys.fail("namespace", f"{text!r} does not look like /robot/arm")
    return "/" + text.strip("/") if text else ""


def _parameters(keys: _Keys, folder: Path) -> tuple[dict[str, Any], Path | None]:
    """An inline table, or the path of a ROS 2 parameter file."""
    found = keys._table.get("parameters", {})
    if isinstance(found, str):
        path = folder / found
        if not path.is_file():
            raise keys.fail("parameters", f"there is no file {path}")
        return {}, path
    if not isinstance(found, dict):
        raise keys.fail("parameters", f"expected a table, or the path of a parameter file, not {_kind(found)}")
    return dict(_flat(keys, found, "")), None


def _flat(keys: _Keys, table: Mapping[str, Any], prefix: str) -> Iterator[tuple[str, Any]]:
    for key, value in table.items():
        if isinstance(value, dict):
            yield from _flat(keys, value, f"{prefix}{key}.")
        elif isinstance(value, bool | int | float | str) or (
            isinstance(value, list) and all(isinstance(item, bool | int | float | str) for item in value)
        ):
            yield f"{prefix}{key}", value
        else:
            raise keys.fail("parameters", f"{prefix}{key}: {_kind(value)} is no parameter value")


def _remap(keys: _Keys) -> dict[str, str]:
    found = keys.value("remap", dict, {})
    for name, target in found.items():
        if not isinstance(target, str) or not target or not name or name.startswith("__") or ":=" in name + target:
            raise keys.fail("remap", f'{name!r}: expected names, such as chatter = "/robot/chatter"')
    return dict(found)


def _policy(keys: _Keys, restart: object) -> RestartPolicy:
    critical = keys.value("critical", bool, False)
    if isinstance(restart, str):
        restart = {"when": restart}
    numbers = _Keys(restart, f"{keys.where}: restart", RESTART_KEYS)
    when = numbers.value("when", str, "always")
    if when not in list(Restart):
        raise numbers.fail("when", f"{when!r} is none of {', '.join(Restart)}")
    given: dict[str, Any] = {"restart": Restart(when), "critical": critical}
    defaults = RestartPolicy()
    for key in RESTART_KEYS[1:]:
        name = _POLICY_FIELDS.get(key, key)
        if key in numbers:
            whole = key == "exits"
            value = numbers.number(key, getattr(defaults, name), low=0.0, high=1e6, whole=whole)
            given[name] = int(value) if whole else value
    return RestartPolicy(**given)


def _ordered(nodes: list[NodeRow], source: str) -> tuple[NodeRow, ...]:
    """Sorted so that each comes after those it needs, else in the order of the file."""
    by_name: dict[str, NodeRow] = {}
    for node in nodes:
        if node.name in by_name:
            raise ConfigError(f"{source}: [[node]] {node.name!r}: name: another node has it already")
        by_name[node.name] = node
    for node in nodes:
        for name in node.after:
            if name not in by_name:
                near = difflib.get_close_matches(name, by_name, n=1)
                hint = f"; did you mean {near[0]!r}?" if near else ""
                raise ConfigError(f"{source}: [[node]] {node.name!r}: after: there is no node {name!r}{hint}")
    try:
        TopologicalSorter({node.name: node.after for node in nodes}).prepare()
    except CycleError as error:
        circle = " → ".join(reversed(error.args[1]))
        raise ConfigError(f"{source}: after: a circle: {circle}; one of them must start first") from None
    ordered: dict[str, NodeRow] = {}
    for node in nodes:
        _place(node, by_name, ordered)
    return tuple(ordered.values())


def _place(node: NodeRow, by_name: Mapping[str, NodeRow], ordered: dict[str, NodeRow]) -> None:
    """Behind those it comes after, which are at most MAX_NODES deep and go in no circle."""
    for name in node.after:
        if name not in ordered:
            _place(by_name[name], by_name, ordered)
    ordered.setdefault(node.name, node)
