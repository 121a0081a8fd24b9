"""Classes of rosidl's shape on nodes of the library, which take them as they take native ones."""

from __future__ import annotations

from array import array
from typing import Any

import metaros
from metaros.idl import message_class
from metaros.ros2.rosidl.catalogue import interface
from tests.metaros.node.action.test_actions import spinning
from tests.support.waiting import wait_until


def test_both_shapes_hear_and_serve_each_other(rclpy_context):
    scan, native_scan = interface("sensor_msgs/msg/LaserScan"), message_class("sensor_msgs/msg/LaserScan")
    fibonacci, native_fibonacci = (get("example_interfaces/action/Fibonacci") for get in (interface, message_class))
    add, native_add = (get("example_interfaces/srv/AddTwoInts") for get in (interface, message_class))
    fed: list[Any] = []
    heard: dict[str, list[Any]] = {"ours": [], "native": []}

    def serve(request: Any, response: Any) -> None:
        assert (type(request), type(response)) == (add.Request, add.Response)
        response.sum = request.a + request.b

    def execute(goal: Any) -> Any:
        assert type(goal.request) is fibonacci.Goal
        goal.publish_feedback(fibonacci.Feedback(sequence=[0, 1]))
        wait_until(lambda: fed)  # a result ends the hearing
        return fibonacci.Result(sequence=array("i", range(goal.request.order)))

    with metaros.Node("shapes", context=rclpy_context.handle) as node:
        ours, native = node.create_publisher(scan, "/a_scan"), node.create_publisher(native_scan, "/b_scan")
        node.create_subscription(native_scan, "/a_scan", heard["native"].append, dedicated=True)
        node.create_subscription(scan, "/b_scan", heard["ours"].append, dedicated=True)
        wait_until(lambda: (ours.publish(scan(ranges=[1.0, 2.5])), heard["native"])[1])
        wait_until(lambda: (native.publish(native_scan(ranges=[1.0, 2.5])), heard["ours"])[1])
        node.create_service(add, "/add_shapes", serve)
        node.create_action_server(fibonacci, "/count_shapes", execute)
        with spinning(node):
            for kind, action in ((add, fibonacci), (native_add, native_fibonacci)):
                client, goals = (
                    node.create_client(kind, "/add_shapes"),
                    node.create_action_client(action, "/count_shapes"),
                )
                answer = client.call(kind.Request(a=2, b=3), timeout_s=60.0)
                fed.clear()
                assert goals.wait_for_server(60.0)
                goal = goals.send_goal(action.Goal(order=3), feedback=fed.append, timeout_s=60.0).wait()
                result = goal.result(60.0).wait().result
                assert (type(answer), answer.sum, type(result)) == (kind.Response, 5, action.Result)
                assert (list(result.sequence), list(fed[0].sequence), type(fed[0])) == (
                    [0, 1, 2],
                    [0, 1],
                    action.Feedback,
                )
    assert (type(heard["native"][0]), heard["native"][0].ranges.tolist()) == (native_scan, [1.0, 2.5])
    assert (type(heard["ours"][0]), heard["ours"][0].ranges) == (scan, array("f", [1.0, 2.5]))
