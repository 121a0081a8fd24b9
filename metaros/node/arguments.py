"""What a program's command line says of its nodes, in ROS 2's grammar: names, remappings, parameters.

    python talker.py --ros-args -r __node:=voice -r __ns:=/robot -r chatter:=talk -p rate:=2.0 --params-file f.yaml

A rule may be meant for one node of several: `talker:chatter:=talk`, `-p talker:rate:=2.0`. `--` ends the section.
Nodes read the command line by themselves; `without_ros_args` gives a program the rest of it.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from metaros.errors import ConfigError, NameError_
from metaros.idl import names
from metaros.limits import LIMITS

__all__ = ["NodeArguments", "RosArguments", "parse_ros_args", "process_arguments", "take_ros_args", "without_ros_args"]

_BEGIN: Final = "--ros-args"
_END: Final = "--"
_REMAP: Final = ("-r", "--remap")
_PARAMETER: Final = ("-p", "--param")
_FILE: Final = "--params-file"
_LEVEL: Final = "--log-level"
_LEVELS: Final = ("DEBUG", "INFO", "WARN", "ERROR", "FATAL")


@dataclass(frozen=True, slots=True)
class Rule:
    """`target:name:=value`; an empty target is every node."""

    target: str
    name: str
    value: str


@dataclass(frozen=True, slots=True)
class NodeArguments:
    """What the command line says of one node."""

    name: str
    namespace: str
    remaps: Mapping[str, str] = field(default_factory=dict)  # full names
    parameters: Mapping[str, Any] = field(default_factory=dict)
    log_level: str = ""

    @property
    def full_name(self) -> str:
        """The name with its namespace."""
        return f"{self.namespace.rstrip('/')}/{self.name}"

    def remapped(self, full_name: str) -> str:
        """The name to use in place of this one."""
        return self.remaps.get(full_name, full_name)


@dataclass(frozen=True, slots=True)
class RosArguments:
    """All `--ros-args` of a command line, in their order."""

    remaps: tuple[Rule, ...] = ()
    parameters: tuple[Rule, ...] = ()  # a file is a rule without a name
    log_level: str = ""

    def for_node(self, name: str, namespace: str) -> NodeArguments:
        """What they say of the node that the program calls so."""
        if not (self.remaps or self.parameters or self.log_level):
            return NodeArguments(name, namespace)
        rules = [rule for rule in self.remaps if rule.target in ("", name)]
        given_name, namespace = name, _first(rules, ("__ns",)) or namespace
        name = _first(rules, ("__node", "__name")) or name
        namespace = "/" + namespace.strip("/")
        names.validate_node(name)
        names.validate_namespace(namespace)
        full_name = f"{namespace.rstrip('/')}/{name}"
        remaps: dict[str, str] = {}
        for rule in rules:
            if not rule.name.startswith("__"):
                remaps.setdefault(*(names.resolve(part, namespace, name) for part in (rule.name, rule.value)))
        parameters = dict(self._parameters({given_name, name}, full_name))
        return NodeArguments(name, namespace, remaps, parameters, self.log_level)

    def _parameters(self, called: set[str], full_name: str) -> Iterator[tuple[str, Any]]:
        from metaros.node.parameters.files import load_file, parse_value  # YAML is loaded where it is needed

        for rule in self.parameters:
            if not rule.name:
                yield from load_file(rule.value, full_name).items()
            elif not rule.target or rule.target in called:
                yield rule.name, parse_value(rule.value)


def process_arguments() -> RosArguments:
    """Those of this process: of its command line, and what a launcher took from it for the nodes."""
    if _BEGIN in sys.argv:
        return parse_ros_args(sys.argv)
    return _taken


def take_ros_args(argv: Sequence[str]) -> list[str]:
    """Keep them for every node of this process, and give the rest of the command line back."""
    global _taken
    _taken = parse_ros_args(argv)
    return without_ros_args(argv)


def without_ros_args(argv: Sequence[str]) -> list[str]:
    """The command line without its `--ros-args` sections: what the program's own parser should see."""
    rest, inside = [], False
    for word in argv:
        if word == _BEGIN:
            inside = True
        elif inside and word == _END:
            inside = False
        elif not inside:
            rest.append(word)
    return rest


def parse_ros_args(argv: Sequence[str]) -> RosArguments:
    """Read every `--ros-args` section; ConfigError names what cannot be read."""
    remaps: list[Rule] = []
    parameters: list[Rule] = []
    level = ""
    words = _section(argv)
    for flag in words:
        if flag in _REMAP:
            remaps.append(_remap_rule(_value(words, flag)))
        elif flag in _PARAMETER:
            parameters.append(_rule(_value(words, flag), flag))
        elif flag == _FILE:
            parameters.append(Rule("", "", _value(words, flag)))
        elif flag == _LEVEL:
            level = _log_level(_value(words, flag))
        else:
            known = ", ".join((*_REMAP, *_PARAMETER, _FILE, _LEVEL))
            raise ConfigError(f"--ros-args: {flag!r} is not known here; there are {known}")
    if len(remaps) + len(parameters) > LIMITS.parameters_per_node:
        raise ConfigError(f"--ros-args: more than {LIMITS.parameters_per_node} rules")
    return RosArguments(tuple(remaps), tuple(parameters), level)


def _section(argv: Sequence[str]) -> Iterator[str]:
    inside = False
    for word in argv:
        if word == _BEGIN:
            inside = True
        elif inside and word == _END:
            inside = False
        elif inside:
            yield word


def _value(words: Iterator[str], flag: str) -> str:
    value = next(words, None)
    if value is None:
        raise ConfigError(f"--ros-args: {flag} needs a value")
    return value


def _rule(text: str, flag: str) -> Rule:
    left, mark, value = text.partition(":=")
    target, colon, name = left.rpartition(":")
    if not mark or not name or (colon and not target):
        raise ConfigError(f"--ros-args: {flag} {text!r}: expected name:=value, or node:name:=value")
    return Rule(target, name, value)


def _remap_rule(text: str) -> Rule:
    rule = _rule(text, "-r")
    try:
        if rule.name in ("__node", "__name"):
            names.validate_node(rule.value)
        elif rule.name == "__ns":
            names.validate_namespace("/" + rule.value.strip("/"))
        elif rule.name.startswith("__"):
            raise ConfigError(f"--ros-args: -r {text!r}: there are __node, __name and __ns, and names of topics")
        else:
            for part in (rule.name, rule.value):
                names.resolve(part, "/", "node")
    except NameError_ as error:
        raise ConfigError(f"--ros-args: -r {text!r}: {error}") from None
    return rule


def _log_level(text: str) -> str:
    level = text.rpartition(":=")[2].upper()
    if level not in _LEVELS:
        raise ConfigError(f"--ros-args: {_LEVEL} {text!r}: expected one of {', '.join(_LEVELS)}")
    return level


_taken = RosArguments()


def _first(rules: Sequence[Rule], wanted: tuple[str, ...]) -> str:
    """The value of the first rule of these names: as in rcl, the first match counts."""
    return next((rule.value for rule in rules if rule.name in wanted), "")
