"""Parameters of nodes: declared, typed, checked, served as ROS 2 nodes serve theirs, and read from afar."""

from metaros.node.parameters.client import ParameterClient, SetResult
from metaros.node.parameters.descriptor import ParameterDescriptor, Range
from metaros.node.parameters.node_parameters import NodeParameters
from metaros.node.parameters.services import offer_parameters
from metaros.node.parameters.setup import declare_sim_time, make_parameters
from metaros.node.parameters.store import ParameterStore
from metaros.node.parameters.values import ParameterType

__all__ = [
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
