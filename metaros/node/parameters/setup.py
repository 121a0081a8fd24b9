"""How a node gets its parameters: overrides from a file and from the program, services where it offers them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final

from metaros.node.parameters.node_parameters import NodeParameters

if TYPE_CHECKING:
    from pathlib import Path

__all__ = ["SIM_TIME", "declare_sim_time", "make_parameters"]

SIM_TIME: Final = "use_sim_time"


def make_parameters(
    node_name: str,
    *,
    overrides: Mapping[str, Any] | None = None,
    file: str | Path | None = None,
    given: Mapping[str, Any] | None = None,
    allow_undeclared: bool = False,
) -> NodeParameters:
    """The parameters of a node with this full name.

    `overrides` win over what the command line has `given`, which wins over what the file says.
    """
    values: dict[str, Any] = {}
    if file is not None:
        from metaros.node.parameters.files import load_file

        values.update(load_file(file, node_name))
    values.update(given or {})
    values.update(overrides or {})
    return NodeParameters(node_name, overrides=values, allow_undeclared=allow_undeclared)


def declare_sim_time(parameters: NodeParameters, default: bool) -> bool:
    """Declare the parameter that every ROS 2 node has, return its value: ours keep the clock they were made with."""
    value: bool = parameters.declare(
        SIM_TIME,
        default,
        description="whether the node's clock follows /clock",
        validate=lambda wanted: wanted == parameters.get(SIM_TIME, wanted) or "it is chosen when the node is made",
    )
    return value
