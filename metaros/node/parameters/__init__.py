"""Parameters of nodes: declared, typed, checked, served as ROS 2 nodes serve theirs, and read remotely."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from metaros.node.parameters.descriptor import ParameterDescriptor, Range
from metaros.node.parameters.node_parameters import NodeParameters
from metaros.node.parameters.services import SERVICES as PARAMETER_SERVICES
from metaros.node.parameters.services import offer_parameters
from metaros.node.parameters.setup import declare_sim_time, make_parameters
from metaros.node.parameters.store import ParameterStore
from metaros.node.parameters.values import ParameterType

if TYPE_CHECKING:
    from metaros.node.parameters.client import ParameterClient, SetResult

__all__ = [
    "PARAMETER_SERVICES",
    "NodeParameters",
    "ParameterClient",
    "ParameterDescriptor",
    "ParameterStore",
    "ParameterType",
    "Range",
    "SetResult",
    "declare_sim_time",
    "make_parameters",
    "offer_parameters",
]


def __getattr__(name: str) -> Any:
    if name not in ("ParameterClient", "SetResult"):  # only who reads other nodes' parameters loads it
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module("metaros.node.parameters.client"), name)
