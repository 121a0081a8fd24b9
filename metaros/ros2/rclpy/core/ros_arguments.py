"""The command line in the library's grammar, with rclpy's errors."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from metaros.errors import ConfigError
from metaros.node.arguments import (
    NodeArguments,
    RosArguments,
    UnknownFlagError,
    parse_ros_args,
    process_arguments,
)
from metaros.ros2.rclpy.core.rcl_errors import RCLInvalidROSArgsError, UnknownROSArgsError

__all__ = ["node_arguments", "parse_arguments"]

_BEGIN: Final = "--ros-args"


def parse_arguments(argv: Sequence[str] | None, *, implied: bool = False) -> RosArguments:
    """Read a command line; None is the process's own. With `implied` it is all of it ROS arguments, as for a node.

    Raises:
        UnicodeEncodeError: a word is no text.
        UnknownROSArgsError: a word after `--ros-args` that is no flag.
        RCLInvalidROSArgsError: a flag's value cannot be read.
    """
    for word in sys.argv if argv is None else argv:
        word.encode()
    try:
        if argv is None:
            return process_arguments()
        return parse_ros_args([_BEGIN, *argv] if implied else argv)
    except UnknownFlagError as error:
        raise UnknownROSArgsError([error.flag]) from None
    except ConfigError as error:
        raise RCLInvalidROSArgsError(f"Failed to parse ROS arguments: {error}") from None


def node_arguments(
    name: str, namespace: str, *, of_context: RosArguments | None, of_node: RosArguments | None
) -> NodeArguments:
    """What both say of a node that the program calls so: for it the node's own arguments come first."""
    first, second = of_node or RosArguments(), of_context or RosArguments()
    merged = replace(
        first,
        remaps=first.remaps + second.remaps,  # of these the first that fits counts
        parameters=second.parameters + first.parameters,  # and of these the last
        log_level=first.log_level or second.log_level,
        log_levels=second.log_levels + first.log_levels,
        enclave=first.enclave if first.enclave != "/" else second.enclave,
        off=first.off | second.off,
    )
    return merged.for_node(name, namespace)
