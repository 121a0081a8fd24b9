"""An action that takes its time: feedback on the way, stops when asked to. Ctrl-C ends it."""

from __future__ import annotations

import metaros
from metaros.interfaces.example_interfaces.action import Fibonacci
from metaros.node import ServerGoal

with metaros.Node("fibonacci_server") as node:

    def wanted(request: Fibonacci.Goal) -> bool:
        return 0 < request.order <= 46  # the next number does not fit an int32

    def execute(goal: ServerGoal) -> Fibonacci.Result | None:
        node.get_logger().info(f"computing up to number {goal.request.order}")
        sequence = [0, 1]
        for number in range(1, goal.request.order):
            if goal.pause(0.2) and goal.is_cancel_requested:  # wakes up at once when the goal should stop
                node.get_logger().info("stopped, as the client wished")
                goal.canceled(Fibonacci.Result(sequence=sequence))
                return None
            sequence.append(sequence[number] + sequence[number - 1])
            goal.publish_feedback(Fibonacci.Feedback(sequence=sequence))
        return Fibonacci.Result(sequence=sequence)  # which means: succeeded

    node.create_action_server(Fibonacci, "fibonacci", execute, goal=wanted)
    metaros.spin(node)
