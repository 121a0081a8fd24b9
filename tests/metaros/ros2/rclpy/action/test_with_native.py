"""Actions of the rclpy face and of the library's own nodes, each as the other's peer on another session."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from typing import Any

import pytest

import metaros
from metaros.interfaces.example_interfaces.action import Fibonacci
from metaros.node.action import GoalState
from metaros.ros2.rclpy.action import ActionClient, ActionServer, CancelResponse
from tests.metaros.ros2.rclpy.action.conftest import WAIT_S, Spun


@pytest.fixture
def peer(ros2_router: str) -> Iterator[metaros.Node]:
    """A node of the library's own, spun by a thread."""
    endpoint = f"tcp/127.0.0.1:{ros2_router}"
    with metaros.Context(domain_id=0, connect=endpoint, environ={}) as context:
        node = metaros.Node("peer", context=context)
        executor = metaros.SingleThreadedExecutor()
        executor.add_node(node)
        thread = threading.Thread(target=executor.spin)
        thread.start()
        yield node
        executor.shutdown()
        thread.join()


def test_a_native_client_of_a_server_of_the_face(in_background: Spun, peer: metaros.Node, fibonacci: Any) -> None:
    running = threading.Event()

    def execute(goal_handle: Any) -> Any:
        goal_handle.publish_feedback(fibonacci.Feedback(sequence=[1]))
        running.set()
        if goal_handle.request.order == 0:
            while not goal_handle.is_cancel_requested:
                assert go_on.wait(WAIT_S)
            goal_handle.canceled()
        else:
            goal_handle.succeed()
        return fibonacci.Result(sequence=[1, goal_handle.request.order])

    def agree(goal_handle: Any) -> CancelResponse:
        return CancelResponse.ACCEPT

    go_on = threading.Event()
    server = ActionServer(in_background.node, fibonacci, "native_client", execute, cancel_callback=agree)
    client = peer.create_action_client(Fibonacci, "/native_client")
    assert client.wait_for_server(WAIT_S)
    heard: list[list[int]] = []
    done = threading.Event()

    def on_feedback(message: Any) -> None:
        heard.append(list(message.sequence))
        done.set()

    goal = client.send_goal(Fibonacci.Goal(order=5), feedback=on_feedback).wait()
    assert done.wait(WAIT_S)  # who has the result hears no more feedback
    end = goal.result().wait()
    assert (end.status, list(end.result.sequence)) == (GoalState.SUCCEEDED, [1, 5])
    assert heard == [[1]]
    running.clear()
    goal = client.send_goal(Fibonacci.Goal(order=0)).wait()
    assert running.wait(WAIT_S)
    assert goal.cancel().wait()
    go_on.set()
    assert goal.result().wait().status is GoalState.CANCELED
    server.destroy()


def test_a_client_of_the_face_of_a_native_server(spun: Spun, peer: metaros.Node, fibonacci: Any) -> None:
    def execute(goal: Any) -> Any:
        goal.publish_feedback(Fibonacci.Feedback(sequence=[2]))
        while goal.request.order == 0 and not goal.pause(WAIT_S):
            pass
        if goal.is_cancel_requested:
            goal.canceled()
        return Fibonacci.Result(sequence=[2, goal.request.order])

    peer.create_action_server(Fibonacci, "/native_server", execute)
    client = ActionClient(spun.node, fibonacci, "native_server")
    assert client.wait_for_server(WAIT_S)
    heard: list[list[int]] = []
    handle = spun.until(
        client.send_goal_async(fibonacci.Goal(order=3), lambda message: heard.append(list(message.feedback.sequence)))
    )
    response = spun.until(handle.get_result_async())
    assert (response.status, list(response.result.sequence)) == (int(GoalState.SUCCEEDED), [2, 3])
    spun.while_not(lambda: heard == [[2]] and handle.status == GoalState.SUCCEEDED)
    handle = spun.until(client.send_goal_async(fibonacci.Goal()))
    assert len(spun.until(handle.cancel_goal_async()).goals_canceling) == 1
    assert spun.until(handle.get_result_async()).status == int(GoalState.CANCELED)
    client.destroy()
