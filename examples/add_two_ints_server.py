"""Serve /add_two_ints: `metaros service call /add_two_ints '{a: 2, b: 3}'` asks it. Ctrl-C ends it."""

from __future__ import annotations

import metaros
from metaros.interfaces.example_interfaces.srv import AddTwoInts

with metaros.Node("add_two_ints_server") as node:

    @node.service(AddTwoInts, "add_two_ints")
    def add(request: AddTwoInts.Request, response: AddTwoInts.Response) -> None:
        response.sum = request.a + request.b
        node.get_logger().info(f"{request.a} + {request.b} = {response.sum}")

    metaros.spin(node)
