"""A managed node with a few parameters, as a robot's supervisor starts it: for tests of nodes of remote robots."""

from __future__ import annotations

import os

from metaros.node.lifecycle import LifecycleNode

__all__ = ["Lidar"]


class Lidar(LifecycleNode):
    """Says a line when it starts and when it is configured."""

    def __init__(self) -> None:
        super().__init__("lidar")
        self.declare_parameter("rate_hz", 10.0, minimum=1.0, maximum=20.0, description="turns a second")
        self.declare_parameter("beams", 360)
        self.declare_parameter("serial", "A-1", read_only=True)
        self.declare_parameter("frames", ["laser", "base"])
        print(f"lidar started as {os.getpid()}", flush=True)

    def on_configure(self) -> None:
        """Say so."""
        print("lidar configured", flush=True)
