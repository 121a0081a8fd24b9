"""A node with parameters. Try: metaros param set /cruise speed 0.8; metaros param describe /cruise speed."""

from __future__ import annotations

import metaros

with metaros.Node("cruise") as node:
    node.declare_parameter("speed", 0.5, minimum=0.0, maximum=1.0, description="m/s")
    node.declare_parameter("direction", "forward", choices=("forward", "backward"))
    node.declare_parameter("gains", [1.0, 0.1])

    @node.parameters.on_change("speed")
    def speed_changed(value: float) -> None:
        node.get_logger().info(f"speed is {value} now")

    @node.parameters.add_on_set_callback
    def careful(values: dict[str, object]) -> str | None:
        """A rule between parameters: backward is slow."""
        wanted = node.parameters.values() | values
        if wanted["direction"] == "backward" and wanted["speed"] > 0.3:
            return "backward goes at most at 0.3"
        return None

    metaros.spin(node)
