"""A ROS 2 program on rclpy: everything that a node of the scenarios offers. It runs on ROS 2 as it is, and here.

python3 robot.py NAME [--ros-args ...]
"""

from __future__ import annotations

import sys
import threading
from typing import Any

import rclpy
from example_interfaces.action import Fibonacci
from example_interfaces.srv import AddTwoInts
from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import ExternalShutdownException, MultiThreadedExecutor
from rclpy.lifecycle import LifecycleNode, TransitionCallbackReturn
from rclpy.node import Node
from rclpy.parameter import Parameter
from sensor_msgs.msg import LaserScan
from std_srvs.srv import Trigger

PATIENT = 30  # a goal of a higher order goes on until it is cancelled


class Robot(Node):  # type: ignore[misc]
    """Services, an action, a parameter."""

    def __init__(self, name: str, **options: Any) -> None:
        super().__init__(name, **options)
        bounds = FloatingPointRange(from_value=0.0, to_value=1.0, step=0.0)
        self.declare_parameter("speed", 0.5, ParameterDescriptor(floating_point_range=[bounds], description="m/s"))
        self.create_service(AddTwoInts, "~/add", self.on_add)
        self.create_subscription(LaserScan, "~/scan", lambda _: None, 10)  # types in use are told to who asks
        offer_now(self)
        self.waits = threading.Event()
        self.fibonacci = ActionServer(
            self,
            Fibonacci,
            f"/{name}/fibonacci",
            execute_callback=self.on_execute,
            goal_callback=lambda goal: GoalResponse.ACCEPT if goal.order >= 0 else GoalResponse.REJECT,
            cancel_callback=lambda _: CancelResponse.ACCEPT,
            callback_group=ReentrantCallbackGroup(),
        )

    def on_add(self, request: Any, response: Any) -> Any:
        response.sum = request.a + request.b
        self.get_logger().info(f"{request.a} + {request.b}")
        return response

    def on_execute(self, goal: Any) -> Any:
        feedback = Fibonacci.Feedback()
        feedback.sequence = [0, 1]
        for at in range(1, min(goal.request.order, PATIENT)):
            feedback.sequence = [*feedback.sequence, feedback.sequence[at] + feedback.sequence[at - 1]]
            goal.publish_feedback(feedback)
        while goal.request.order > PATIENT and not goal.is_cancel_requested:
            self.waits.wait(0.01)
        if goal.is_cancel_requested:
            goal.canceled()
        else:
            goal.succeed()
        result = Fibonacci.Result()
        result.sequence = feedback.sequence
        return result

    def destroy_node(self) -> None:
        """The action server first."""
        self.fibonacci.destroy()
        super().destroy_node()


class Clocked(Node):  # type: ignore[misc]
    """Follows /clock."""

    def __init__(self, name: str, **options: Any) -> None:
        super().__init__(name, parameter_overrides=[Parameter("use_sim_time", value=True)], **options)
        offer_now(self)


def offer_now(node: Any) -> None:
    """The node's time, when asked."""

    def on_now(_: Any, response: Any) -> Any:
        response.success = True
        response.message = str(node.get_clock().now().nanoseconds)
        return response

    node.create_service(Trigger, "~/now", on_now)


class Managed(LifecycleNode):  # type: ignore[misc]
    """Obeys every transition."""

    def on_configure(self, _: Any) -> Any:
        return TransitionCallbackReturn.SUCCESS


def main() -> None:
    """Until it is told to end."""
    rclpy.init()
    name = rclpy.utilities.remove_ros_args(sys.argv)[1]
    nodes = [Robot(name), Managed(f"{name}_managed"), Clocked(f"{name}_clocked")]
    executor = MultiThreadedExecutor(num_threads=4)
    for node in nodes:
        executor.add_node(node)
    try:
        executor.spin()
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        for node in nodes:
            node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
