"""What the action tutorials' programs do, typed anew: servers of every kind, and clients of each."""

from __future__ import annotations

import asyncio
import threading
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any

import pytest

from tests.support.waiting import wait_until

pytestmark = pytest.mark.usefixtures("rclpy_program")

TEN = [0, 1, 1, 2, 3, 5, 8, 13, 21, 34, 55]


@contextmanager
def in_background(make_node: Callable[[], Any]) -> Iterator[Any]:
    """A node that a thread spins with an executor of several threads."""
    from rclpy.executors import MultiThreadedExecutor

    node = make_node()
    executor = MultiThreadedExecutor(num_threads=3)
    executor.add_node(node)
    thread = threading.Thread(target=executor.spin)
    thread.start()
    try:
        yield node
    finally:
        executor.shutdown()
        thread.join()


def server_class() -> type[Any]:
    """A Fibonacci server. `step` is waited for before every number after the first."""
    from example_interfaces.action import Fibonacci
    from rclpy.action import ActionServer, CancelResponse, GoalResponse
    from rclpy.callback_groups import ReentrantCallbackGroup
    from rclpy.node import Node

    class Server(Node):  # type: ignore[misc]
        def __init__(self, execute: Any = None, handle_accepted: Any = None) -> None:
            super().__init__("minimal_action_server")
            self.step = threading.Semaphore(0)
            self.said: list[str] = []
            options = {} if handle_accepted is None else {"handle_accepted_callback": handle_accepted}
            self._action_server = ActionServer(
                self,
                Fibonacci,
                "fibonacci",
                execute_callback=execute or self.execute_callback,
                callback_group=ReentrantCallbackGroup(),
                goal_callback=lambda request: GoalResponse.ACCEPT if request.order < 100 else GoalResponse.REJECT,
                cancel_callback=lambda goal_handle: CancelResponse.ACCEPT,
                **options,
            )

        async def execute_callback(self, goal_handle: Any) -> Any:
            return self.work(goal_handle)

        def work(self, goal_handle: Any) -> Any:
            feedback = Fibonacci.Feedback()
            feedback.sequence = [0, 1]
            for index in range(1, goal_handle.request.order):
                if index > 1:
                    self.step.acquire(timeout=30)
                if not goal_handle.is_active:
                    self.said.append("aborted")
                    return Fibonacci.Result()
                if goal_handle.is_cancel_requested:
                    goal_handle.canceled()
                    self.said.append("canceled")
                    return Fibonacci.Result()
                feedback.sequence.append(feedback.sequence[index] + feedback.sequence[index - 1])
                goal_handle.publish_feedback(feedback)
            goal_handle.succeed()
            result = Fibonacci.Result()
            result.sequence = feedback.sequence
            return result

    return Server


def test_callbacks_from_the_goal_to_its_result() -> None:
    import rclpy
    from action_msgs.msg import GoalStatus
    from example_interfaces.action import Fibonacci
    from rclpy.action import ActionClient
    from rclpy.node import Node

    class Client(Node):  # type: ignore[misc]
        def __init__(self) -> None:
            super().__init__("minimal_action_client")
            self._action_client = ActionClient(self, Fibonacci, "fibonacci")
            self.heard: list[Any] = []

        def send_goal(self, order: int) -> None:
            self._action_client.wait_for_server()
            goal = Fibonacci.Goal()
            goal.order = order
            self._send_goal_future = self._action_client.send_goal_async(
                goal, feedback_callback=lambda message: self.heard.append(list(message.feedback.sequence))
            )
            self._send_goal_future.add_done_callback(self.goal_response_callback)

        def goal_response_callback(self, future: Any) -> None:
            goal_handle = future.result()
            if not goal_handle.accepted:
                self.heard.append("rejected")
                self.send_goal(10)
                return
            self._get_result_future = goal_handle.get_result_async()
            self._get_result_future.add_done_callback(self.get_result_callback)

        def get_result_callback(self, future: Any) -> None:
            self.result = future.result()
            rclpy.shutdown()

    rclpy.init(args=None)
    server = server_class()
    with in_background(server) as node:
        node.step.release(100)
        client = Client()
        client.send_goal(100)
        rclpy.spin(client)
    assert client.result.status == GoalStatus.STATUS_SUCCEEDED
    assert list(client.result.result.sequence) == TEN
    assert client.heard == ["rejected", *[TEN[:count] for count in range(3, 12)]]


def test_futures_that_are_spun_for_and_a_goal_that_is_canceled() -> None:
    import rclpy
    from action_msgs.msg import GoalStatus
    from example_interfaces.action import Fibonacci
    from rclpy.action import ActionClient

    with rclpy.init(), in_background(server_class()) as server:
        node = rclpy.create_node("minimal_action_client")
        action_client = ActionClient(node, Fibonacci, "fibonacci")
        assert action_client.wait_for_server(timeout_sec=30)
        heard: list[int] = []
        future = action_client.send_goal_async(
            Fibonacci.Goal(order=10), feedback_callback=lambda message: heard.append(len(message.feedback.sequence))
        )
        rclpy.spin_until_future_complete(node, future)
        goal_handle = future.result()
        assert goal_handle.accepted
        while not heard:
            rclpy.spin_once(node, timeout_sec=1.0)
        cancel = goal_handle.cancel_goal_async()
        rclpy.spin_until_future_complete(node, cancel)
        assert [info.goal_id for info in cancel.result().goals_canceling] == [goal_handle.goal_id]
        server.step.release()
        result = goal_handle.get_result_async()
        rclpy.spin_until_future_complete(node, result)
        assert result.result().status == GoalStatus.STATUS_CANCELED
        assert server.said == ["canceled"]
        assert heard == [3]


def test_a_server_of_one_goal_at_a_time_and_a_client_that_waits() -> None:
    import rclpy
    from action_msgs.msg import GoalStatus
    from example_interfaces.action import Fibonacci
    from rclpy.action import ActionClient

    lock = threading.Lock()
    current: list[Any] = []

    def handle_accepted(goal_handle: Any) -> None:
        with lock:
            if current and current[-1].is_active:
                current[-1].abort()
            current.append(goal_handle)
        goal_handle.execute()

    rclpy.init()
    base = server_class()
    with in_background(lambda: base(handle_accepted=handle_accepted)) as server:
        node = rclpy.create_node("minimal_action_client")
        action_client = ActionClient(node, Fibonacci, "fibonacci")
        spinning = threading.Thread(target=spin_while_ok, args=(node,))
        spinning.start()
        action_client.wait_for_server()
        with ThreadPoolExecutor(2) as pool:
            first = pool.submit(action_client.send_goal, Fibonacci.Goal(order=10))
            wait_until(lambda: len(current) == 1)
            second = pool.submit(action_client.send_goal, Fibonacci.Goal(order=10))
            wait_until(lambda: len(current) == 2)
            server.step.release(100)
        results = [first.result(), second.result()]
        rclpy.shutdown()
        spinning.join()
        action_client.destroy()
    assert [found.status for found in results] == [GoalStatus.STATUS_ABORTED, GoalStatus.STATUS_SUCCEEDED]
    assert list(results[1].result.sequence) == TEN
    assert server.said == ["aborted"]


def spin_while_ok(node: Any) -> None:
    import rclpy

    while rclpy.utilities.ok():
        try:
            rclpy.spin_once(node, timeout_sec=0.05)
        except rclpy.executors.ExternalShutdownException:
            return


def test_a_server_that_queues_and_a_client_on_asyncio() -> None:
    import rclpy
    from example_interfaces.action import Fibonacci
    from rclpy.action import ActionClient
    from rclpy.node import Node

    waiting: deque[Any] = deque()
    lock = threading.Lock()
    running: list[Any] = []
    most: list[int] = []

    def handle_accepted(goal_handle: Any) -> None:
        with lock:
            if running:
                waiting.append(goal_handle)
            else:
                running.append(goal_handle)
                goal_handle.execute()

    base = server_class()

    class Queueing(base):  # type: ignore[valid-type, misc]
        def __init__(self) -> None:
            super().__init__(execute=self.one_by_one, handle_accepted=handle_accepted)

        def one_by_one(self, goal_handle: Any) -> Any:
            try:
                most.append(len(running))
                return self.work(goal_handle)
            finally:
                with lock:
                    running.clear()
                    if waiting:
                        running.append(waiting.popleft())
                        running[0].execute()

    class Client(Node):  # type: ignore[misc]
        def __init__(self) -> None:
            super().__init__("minimal_action_client")
            self._action_client = ActionClient(self, Fibonacci, "fibonacci")

        async def send_goal(self) -> Any:
            self._action_client.wait_for_server()
            goal_handle = await self._action_client.send_goal_async(Fibonacci.Goal(order=10))
            found = await goal_handle.get_result_async()
            return found.status, list(found.result.sequence)

    async def spinning(node: Any) -> None:
        while rclpy.ok():
            rclpy.spin_once(node, timeout_sec=0.001)
            await asyncio.sleep(0)

    async def run(node: Any) -> list[Any]:
        spin_task = asyncio.create_task(spinning(node))
        found = await asyncio.gather(node.send_goal(), node.send_goal())
        spin_task.cancel()
        return [*found]

    with rclpy.init(), in_background(Queueing) as server:
        server.step.release(100)
        assert asyncio.run(run(Client())) == [(4, TEN), (4, TEN)]
    assert most == [1, 1]


def test_a_goal_that_a_timer_starts_and_a_callback_with_a_loop_of_its_own() -> None:
    import rclpy
    from example_interfaces.action import Fibonacci
    from rclpy.action import ActionClient

    base = server_class()
    loops: list[Any] = []

    class Deferring(base):  # type: ignore[valid-type, misc]
        def __init__(self) -> None:
            super().__init__(execute=self.on_a_loop, handle_accepted=self.later)

        def later(self, goal_handle: Any) -> None:
            self._goal_handle = goal_handle
            self._timer = self.create_timer(0.01, self.start)

        def start(self) -> None:
            self._timer.cancel()
            self._goal_handle.execute()

        def on_a_loop(self, goal_handle: Any) -> Any:
            async def body() -> Any:
                loops.append(asyncio.get_running_loop())
                await asyncio.sleep(0)
                return self.work(goal_handle)

            return asyncio.run(body())

    with rclpy.init(), in_background(Deferring) as server:
        server.step.release(100)
        node = rclpy.create_node("minimal_action_client")
        action_client = ActionClient(node, Fibonacci, "fibonacci")
        assert action_client.wait_for_server(timeout_sec=30)
        found = action_client.send_goal(Fibonacci.Goal(order=10))
        assert list(found.result.sequence) == TEN
    assert len(loops) == 1
