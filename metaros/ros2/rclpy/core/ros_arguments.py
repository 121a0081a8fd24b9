"""What the command line says, as rclpy reads it: the library's own grammar, and the flags that only rclpy knows.

The errors are rclpy's: `UnknownROSArgsError` names the words that nobody knows.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

from metaros.errors import ConfigError
from metaros.node.arguments import NodeArguments, RosArguments, parse_ros_args, process_arguments
from metaros.ros2.rclpy.core.rcl_errors import RCLInvalidROSArgsError, UnknownROSArgsError

__all__ = ["Arguments", "node_arguments", "parse_arguments", "remaining"]

_BEGIN: Final = "--ros-args"
_END: Final = "--"
_NATIVE: Final = ("-r", "--remap", "-p", "--param", "--params-file")  # each with a value
_LEVEL: Final = "--log-level"
_WITH_VALUE: Final = ("-e", "--enclave", "--log-config-file", "--log-file-name")
_SWITCHES: Final = tuple(
    f"--{word}-{what}" for word in ("enable", "disable") for what in ("rosout-logs", "stdout-logs", "external-lib-logs")
)


@dataclass(frozen=True, slots=True)
class Arguments:
    """The library's part, and the rest: an enclave, levels of loggers by name, what is switched off."""

    ros: RosArguments = field(default_factory=RosArguments)
    enclave: str = ""
    log_levels: tuple[tuple[str, str], ...] = ()  # of loggers by name; "" is that of all
    off: frozenset[str] = frozenset()  # of rosout-logs, stdout-logs, external-lib-logs


def parse_arguments(argv: Sequence[str] | None, *, implied: bool = False) -> Arguments:
    """Read a command line; None is the process's own. With `implied` it is all of it ROS arguments, as for a node.

    Raises:
        UnicodeEncodeError: a word is no text.
        UnknownROSArgsError: a word after `--ros-args` that is no flag.
        RCLInvalidROSArgsError: a flag's value cannot be read.
    """
    if argv is None:
        import sys

        argv = sys.argv
        if _BEGIN not in argv:  # what a launcher took from the command line for us, if one did
            return Arguments(process_arguments())
    for word in argv:
        word.encode()
    if implied:
        argv = [_BEGIN, *argv]
    return _parse(list(_section(argv)))


def _parse(words: list[str]) -> Arguments:
    native: list[str] = [_BEGIN]
    unknown: list[str] = []
    levels: list[tuple[str, str]] = []
    off: set[str] = set()
    enclave = ""
    rest = iter(words)
    for word in rest:
        if word in _NATIVE:
            native += [word, _value(rest, word)]
        elif word == _LEVEL:
            name, _, level = _value(rest, word).rpartition(":=")
            levels.append((name, level))
        elif word in ("-e", "--enclave"):
            enclave = _value(rest, word)
        elif word in _WITH_VALUE:
            _value(rest, word)
        elif word in _SWITCHES:
            (off.add if word.startswith("--disable-") else off.discard)(word.split("-", 3)[3])
        else:
            unknown.append(word)
    if unknown:
        raise UnknownROSArgsError(f"found unknown ROS arguments: {unknown}")
    for name, level in levels:
        if not name:
            native += [_LEVEL, level]
    try:
        ros = parse_ros_args(native)
        for _, level in levels:
            parse_ros_args([_BEGIN, _LEVEL, level])
    except ConfigError as error:
        raise RCLInvalidROSArgsError(f"Failed to parse ROS arguments: {error}") from None
    return Arguments(ros, enclave, tuple((name, level.upper()) for name, level in levels), frozenset(off))


def node_arguments(
    name: str, namespace: str, *, of_context: Arguments | None, of_node: Arguments | None
) -> NodeArguments:
    """What both say of a node that the program calls so: for it the node's own arguments come first."""
    first, second = (of_node or Arguments()).ros, (of_context or Arguments()).ros
    merged = replace(
        first,
        remaps=first.remaps + second.remaps,  # of these the first that fits counts
        parameters=second.parameters + first.parameters,  # and of these the last
        log_level=first.log_level or second.log_level,
    )
    return merged.for_node(name, namespace)


def remaining(argv: Sequence[str]) -> list[str]:
    """The command line without its ROS arguments."""
    from metaros.node.arguments import without_ros_args

    return without_ros_args(argv)


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
        raise RCLInvalidROSArgsError(f"Failed to parse ROS arguments: {flag} needs a value")
    return value
