"""Descriptions of nodes and parameters."""

from __future__ import annotations

from typing import Any

from metaros.ros2.launch_ros.parameter_descriptions import Parameter, ParameterFile, ParameterValue

__all__ = ["ComposableNode", "Parameter", "ParameterFile", "ParameterValue"]


class ComposableNode:
    """A node that a C++ container would load: named, so that files that mention one can be read; it is not run."""

    def __init__(self, *, package: Any, plugin: Any, name: Any = None, **options: Any) -> None:
        self.package, self.plugin, self.name, self.options = package, plugin, name, options
