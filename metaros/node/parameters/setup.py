"""How a node gets its parameters: overrides from a file and from the program, services where it offers them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from metaros.node.parameters.node_parameters import NodeParameters

__all__ = ["make_parameters"]


def make_parameters(
    node_name: str,
    *,
    overrides: Mapping[str, Any] | None = None,
    file: str | Path | None = None,
    allow_undeclared: bool = False,
) -> NodeParameters:
    """The parameters of a node with this full name; `overrides` win over what the file says."""
    given: dict[str, Any] = {}
    if file is not None:
        from metaros.node.parameters.files import load_file

        given.update(load_file(file, node_name))
    given.update(overrides or {})
    return NodeParameters(node_name, overrides=given, allow_undeclared=allow_undeclared)
