"""What a program's command line says of its nodes, in ROS 2's grammar: names, remappings, parameters.

    python talker.py --ros-args -r __node:=voice -r __ns:=/robot -r chatter:=talk -p rate:=2.0 --params-file f.yaml

A rule may be meant for one node of several: `talker:chatter:=talk`, `-p talker:rate:=2.0`; or for topics or services
alone: `rostopic://chatter:=talk`, `rosservice://add:=sum`. Levels of loggers go by name, too: `--log-level
robot.voice:=debug`. `--` ends the section. Nodes read the command line by themselves; `without_ros_args` gives a
program the rest of it.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from metaros.errors import ConfigError, NameError_
from metaros.idl import names
from metaros.limits import LIMITS

__all__ = [
    "NodeArguments",
    "RosArguments",
    "UnknownFlagError",
    "parse_ros_args",
    "process_arguments",
    "take_ros_args",
    "without_ros_args",
]

_BEGIN: Final = "--ros-args"
_END: Final = "--"
_REMAP: Final = ("-r", "--remap")
_PARAMETER: Final = ("-p", "--param")
_FILE: Final = "--params-file"
_LEVEL: Final = "--log-level"
_ENCLAVE: Final = ("-e", "--enclave")
_UNUSED: Final = ("--log-config-file", "--log-file-name")  # of rcl's own log files; read, so that programs start
_SWITCHES: Final = {  # whether it switches off
    f"--{word}-{what}": word == "disable"
    for what in ("rosout-logs", "stdout-logs", "external-lib-logs")
    for word in ("enable", "disable")
}
_SCHEMES: Final = ("rostopic", "rosservice")
_LEVELS: Final = ("DEBUG", "INFO", "WARN", "ERROR", "FATAL")


class UnknownFlagError(ConfigError):
    """A word after `--ros-args` that is none of the flags there are."""

    def __init__(self, flag: str) -> None:
        known = ", ".join((*_REMAP, *_PARAMETER, _FILE, _LEVEL, *_ENCLAVE, *_UNUSED, *_SWITCHES))
        super().__init__(f"--ros-args: {flag!r} is not known here; there are {known}")
        self.flag = flag


@dataclass(frozen=True, slots=True)
class Rule:
    """`target:name:=value`; an empty target is every node, an empty scheme both topics and services."""

    target: str
    name: str
    value: str
    scheme: str = ""  # "rostopic" or "rosservice"


@dataclass(frozen=True, slots=True)
class NodeArguments:
    """What the command line says of one node."""

    name: str
    namespace: str
    remaps: Mapping[str, str] = field(default_factory=dict)  # full names, of topics
    parameters: Mapping[str, Any] = field(default_factory=dict)
    log_level: str = ""
    service_remaps: Mapping[str, str] = field(default_factory=dict)
    enclave: str = "/"
    rosout_logs: bool = True
    stdout_logs: bool = True

    @property
    def full_name(self) -> str:
        """The name with its namespace."""
        return f"{self.namespace.rstrip('/')}/{self.name}"

    def remapped(self, full_name: str, *, service: bool = False) -> str:
        """The name to use in place of this one."""
        return (self.service_remaps if service else self.remaps).get(full_name, full_name)


@dataclass(frozen=True, slots=True)
class RosArguments:
    """All `--ros-args` of a command line, in their order."""

    remaps: tuple[Rule, ...] = ()
    parameters: tuple[Rule, ...] = ()  # a file is a rule without a name
    log_level: str = ""
    log_levels: tuple[tuple[str, str], ...] = ()  # of loggers by name, and those below it
    enclave: str = "/"
    off: frozenset[str] = frozenset()  # of rosout-logs, stdout-logs, external-lib-logs

    def for_node(self, name: str, namespace: str) -> NodeArguments:
        """What they say of the node that the program calls so."""
        if self == _NOTHING:
            return NodeArguments(name, namespace)
        rules = [rule for rule in self.remaps if rule.target in ("", name)]
        given_name, namespace = name, _first(rules, ("__ns",)) or namespace
        name = _first(rules, ("__node", "__name")) or name
        namespace = "/" + namespace.strip("/")
        names.validate_node(name)
        names.validate_namespace(namespace)
        full_name = f"{namespace.rstrip('/')}/{name}"
        remaps: dict[str, dict[str, str]] = {"rostopic": {}, "rosservice": {}}
        for rule in rules:
            if not rule.name.startswith("__"):
                pair = [names.resolve(part, namespace, name) for part in (rule.name, rule.value)]
                for scheme in [rule.scheme] if rule.scheme else remaps:
                    remaps[scheme].setdefault(*pair)
        return NodeArguments(
            name,
            namespace,
            remaps["rostopic"],
            dict(self._parameters({given_name, name}, full_name)),
            self.level_of(full_name.lstrip("/").replace("/", ".")),
            remaps["rosservice"],
            enclave=self.enclave,
            rosout_logs="rosout-logs" not in self.off,
            stdout_logs="stdout-logs" not in self.off,
        )

    def level_of(self, logger: str) -> str:
        """The level of a logger, which is its own or that of the closest above it; empty where nothing is said."""
        levels = dict(self.log_levels)
        while logger:
            if logger in levels:
                return levels[logger]
            logger = logger.rpartition(".")[0]
        return self.log_level

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
    levels: dict[str, str] = {}
    enclave = "/"
    off: set[str] = set()
    words = _section(argv)
    for flag in words:
        if flag in _REMAP:
            remaps.append(_remap_rule(_value(words, flag)))
        elif flag in _PARAMETER:
            parameters.append(_rule(_value(words, flag), "", flag))
        elif flag == _FILE:
            parameters.append(Rule("", "", _value(words, flag)))
        elif flag == _LEVEL:
            name, level = _log_level(_value(words, flag))
            levels[name] = level
        elif flag in _ENCLAVE:
            enclave = _enclave(_value(words, flag))
        elif flag in _UNUSED:
            _value(words, flag)
        elif flag in _SWITCHES:
            (off.add if _SWITCHES[flag] else off.discard)(flag.split("-", 3)[3])
        else:
            raise UnknownFlagError(flag)
    if len(remaps) + len(parameters) + len(levels) > LIMITS.parameters_per_node:
        raise ConfigError(f"--ros-args: more than {LIMITS.parameters_per_node} rules")
    level = levels.pop("", "")
    return RosArguments(tuple(remaps), tuple(parameters), level, tuple(levels.items()), enclave, frozenset(off))


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


def _without_scheme(text: str) -> tuple[str, str]:
    """`node:rostopic://name:=value` without the scheme, and the scheme."""
    left, mark, value = text.partition(":=")
    for scheme in _SCHEMES:
        before, found, after = left.partition(f"{scheme}://")
        if found and (not before or before.endswith(":")):
            return f"{before}{after}{mark}{value}", scheme
    return text, ""


def _rule(text: str, scheme: str, flag: str) -> Rule:
    left, mark, value = text.partition(":=")
    target, colon, name = left.rpartition(":")
    if not mark or not name or (colon and not target):
        raise ConfigError(f"--ros-args: {flag} {text!r}: expected name:=value, or node:name:=value")
    return Rule(target, name, value, scheme)


def _remap_rule(text: str) -> Rule:
    rule = _rule(*_without_scheme(text), "-r")
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


def _log_level(text: str) -> tuple[str, str]:
    name, mark, level = text.rpartition(":=")
    if level.upper() not in _LEVELS or (mark and not name):
        raise ConfigError(f"--ros-args: {_LEVEL} {text!r}: expected one of {', '.join(_LEVELS)}, or logger:=LEVEL")
    return name, level.upper()


def _enclave(text: str) -> str:
    enclave = "/" + text.strip("/")
    try:
        return names.validate_namespace(enclave)
    except NameError_ as error:
        raise ConfigError(f"--ros-args: {_ENCLAVE[1]} {text!r}: {error}") from None


_NOTHING: Final = RosArguments()
_taken = RosArguments()


def _first(rules: Sequence[Rule], wanted: tuple[str, ...]) -> str:
    """The value of the first rule of these names: as in rcl, the first match counts."""
    return next((rule.value for rule in rules if rule.name in wanted), "")
