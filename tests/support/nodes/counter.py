"""An action server that counts on when a test lets it."""

from __future__ import annotations

import threading
from typing import Any

import metaros
from metaros.idl import message_class
from metaros.node.action import ServerGoal

__all__ = ["FIBONACCI", "Counter"]

FIBONACCI = message_class("example_interfaces/action/Fibonacci")


class Counter:
    """Serves `name`: a goal's order is how many steps; each `go.release()` lets one happen. A cancel stops it."""

    def __init__(self, node: metaros.Node, name: str = "count") -> None:
        self.go = threading.Semaphore(0)
        self.server = node.create_action_server(
            FIBONACCI, name, self.execute, goal=lambda goal: goal.order >= 0, cancel=lambda goal: True
        )

    def execute(self, goal: ServerGoal) -> Any:
        """On a worker's thread."""
        sequence: list[int] = []
        for number in range(goal.request.order):
            while not self.go.acquire(timeout=0.02):
                if goal.should_stop:
                    result = FIBONACCI.Result(sequence=sequence)
                    if goal.is_cancel_requested:
                        goal.canceled(result)
                    return result
            sequence.append(number)
            goal.publish_feedback(FIBONACCI.Feedback(sequence=sequence))
        goal.succeed()
        return FIBONACCI.Result(sequence=sequence)
