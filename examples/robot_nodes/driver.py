"""A pretended range sensor: a module of a launch table, which also runs by itself: python -m robot_nodes.driver."""

from __future__ import annotations

import metaros
from metaros.interfaces.std_msgs.msg import Float64
from metaros.interfaces.std_srvs.srv import Trigger

with metaros.Node("driver") as node:
    rate_hz = node.declare_parameter("rate_hz", 1.0)
    sensor = node.declare_parameter("sensor", "any")
    publisher = node.create_publisher(Float64, "range", 10)
    node.get_logger().info(f"the {sensor} sensor measures {rate_hz:g} times a second")

    @node.service(Trigger, "/driver/stop")
    def stop(request: Trigger.Request, response: Trigger.Response) -> None:
        response.success = True

    distance_m = 0.0

    @node.timer(1.0 / rate_hz)
    def measure() -> None:
        global distance_m
        distance_m = (distance_m + 0.1) % 5.0
        publisher.publish(Float64(data=distance_m))

    metaros.spin(node)
