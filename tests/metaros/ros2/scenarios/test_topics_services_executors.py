"""What the tutorials' programs do, by the names that they import: topics, services, guard conditions, executors."""

from __future__ import annotations

import threading
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest

pytestmark = pytest.mark.usefixtures("rclpy_program")


def test_a_publisher_and_a_subscriber_of_member_functions() -> None:
    import rclpy
    from rclpy.node import Node
    from std_msgs.msg import String

    class MinimalPublisher(Node):
        def __init__(self) -> None:
            super().__init__("minimal_publisher")
            self.publisher_ = self.create_publisher(String, "topic", 10)
            self.timer = self.create_timer(0.001, self.timer_callback)
            self.i = 0

        def timer_callback(self) -> None:
            msg = String()
            msg.data = f"Hello World: {self.i}"
            self.publisher_.publish(msg)
            self.i += 1

    class MinimalSubscriber(Node):
        def __init__(self) -> None:
            super().__init__("minimal_subscriber")
            self.subscription = self.create_subscription(String, "topic", self.listener_callback, 10)
            self.heard: list[str] = []

        def listener_callback(self, msg: Any) -> None:
            self.heard.append(msg.data)
            if len(self.heard) == 3:
                rclpy.shutdown()

    rclpy.init(args=None)
    publisher, subscriber = MinimalPublisher(), MinimalSubscriber()
    executor = rclpy.executors.MultiThreadedExecutor(num_threads=2)
    for node in (publisher, subscriber):
        executor.add_node(node)
    executor.spin()
    executor.shutdown()
    assert subscriber.heard[:3] == [f"Hello World: {number}" for number in range(3)]


def test_a_subscriber_of_a_lambda_and_a_loop_of_spin_once() -> None:
    import rclpy
    from std_msgs.msg import String

    heard: list[str] = []
    rclpy.init()
    node = rclpy.create_node("minimal_subscriber")
    subscription = node.create_subscription(String, "topic", lambda msg: heard.append(msg.data), 10)
    publisher = node.create_publisher(String, "topic", 10)
    while rclpy.ok() and len(heard) < 3:
        publisher.publish(String(data=str(len(heard))))
        rclpy.spin_once(node, timeout_sec=30)
    assert heard == ["0", "1", "2"]
    assert subscription.topic_name == "/topic"
    node.destroy_node()
    rclpy.shutdown()


def test_a_service_and_its_clients() -> None:
    import rclpy
    from example_interfaces.srv import AddTwoInts
    from rclpy.callback_groups import ReentrantCallbackGroup
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.node import Node

    class MinimalService(Node):
        def __init__(self) -> None:
            super().__init__("minimal_service")
            self.srv = self.create_service(AddTwoInts, "add_two_ints", self.add_two_ints_callback)

        def add_two_ints_callback(self, request: Any, response: Any) -> Any:
            response.sum = request.a + request.b
            return response

    with rclpy.init():
        server = MinimalService()
        serving = SingleThreadedExecutor()
        serving.add_node(server)
        thread = threading.Thread(target=serving.spin)
        thread.start()
        try:
            node = rclpy.create_node("minimal_client")
            client = node.create_client(AddTwoInts, "add_two_ints", callback_group=ReentrantCallbackGroup())
            while not client.wait_for_service(timeout_sec=1.0):
                pass
            future = client.call_async(AddTwoInts.Request(a=41, b=1))
            while rclpy.ok() and not future.done():
                rclpy.spin_once(node)
            assert future.result().sum == 42
            assert client.call(AddTwoInts.Request(a=1, b=2)).sum == 3
            results: list[int] = []

            async def call_service() -> None:
                result = await client.call_async(AddTwoInts.Request(a=2, b=3))
                results.append(result.sum)

            timer = node.create_timer(0.001, call_service, callback_group=client.callback_group)
            while not results:
                rclpy.spin_once(node)
                timer.cancel()
            assert results == [5]
        finally:
            serving.shutdown()
            thread.join()


def test_a_guard_condition_that_shuts_down() -> None:
    import rclpy

    rclpy.init()
    node = rclpy.create_node("demo_guard_condition")
    executor = rclpy.executors.SingleThreadedExecutor()
    executor.add_node(node)
    steps: list[str] = []

    def guard_condition_callback() -> None:
        rclpy.shutdown()
        node.get_logger().debug("after the shutdown")
        steps.append("guard")

    def timer_callback() -> None:
        guard_condition.trigger()
        steps.append("timer")

    node.create_timer(timer_period_sec=0.05, callback=timer_callback)
    guard_condition = node.create_guard_condition(guard_condition_callback)
    while rclpy.ok():
        executor.spin_once()
    assert steps[0] == "timer"
    assert steps[-1] == "guard"


def spin_for_ever(executor: Any) -> None:
    while True:
        executor.spin_once(timeout_sec=30)


def test_an_executor_and_a_callback_group_of_ones_own() -> None:
    import rclpy
    from rclpy.callback_groups import CallbackGroup
    from rclpy.executors import Executor
    from std_msgs.msg import String

    class Throttled(CallbackGroup):  # type: ignore[misc]
        def __init__(self) -> None:
            super().__init__()
            self.bucket = 2
            self.entities_seen: list[Any] = []

        def can_execute(self, entity: Any) -> bool:
            return self.bucket > 0

        def beginning_execution(self, entity: Any) -> bool:
            self.entities_seen.append(entity)
            self.bucket -= 1
            return True

        def ending_execution(self, entity: Any) -> None:
            pass

    class PriorityExecutor(Executor):  # type: ignore[misc]
        def __init__(self) -> None:
            super().__init__()
            self.high_priority_nodes: set[Any] = set()
            self.threads = {kind: ThreadPoolExecutor(1, thread_name_prefix=kind) for kind in ("high", "low")}

        def add_high_priority_node(self, node: Any) -> None:
            self.high_priority_nodes.add(node)
            self.add_node(node)

        def spin_once(self, timeout_sec: float | None = None) -> None:
            handler, _, node = self.wait_for_ready_callbacks(timeout_sec=timeout_sec)
            self.threads["high" if node in self.high_priority_nodes else "low"].submit(handler)

    rclpy.init()
    ran: dict[str, list[str]] = {"stopper": [], "talker": []}
    stopper, talker = rclpy.create_node("stopper"), rclpy.create_node("talker")
    group = Throttled()

    def note(name: str) -> None:
        ran[name].append(threading.current_thread().name.partition("_")[0])
        if len(ran["stopper"]) == 2 and len(ran["talker"]) == 2:
            rclpy.shutdown()

    stopper.create_subscription(String, "estop", lambda msg: note("stopper"), 10)
    publisher = talker.create_publisher(String, "estop", 10)
    timer = talker.create_timer(0.001, lambda: (publisher.publish(String()), note("talker")), callback_group=group)
    executor = PriorityExecutor()
    executor.add_high_priority_node(stopper)
    executor.add_node(talker)
    with pytest.raises(rclpy.executors.ExternalShutdownException):
        spin_for_ever(executor)
    for pool in executor.threads.values():
        pool.shutdown()
    assert ran == {"stopper": ["high", "high"], "talker": ["low", "low"]}
    assert group.entities_seen == [timer, timer]


def test_a_loop_around_a_wait_ends_with_its_context() -> None:
    import rclpy
    from example_interfaces.action import Fibonacci
    from example_interfaces.srv import AddTwoInts
    from rclpy._rclpy_pybind11 import RCLError
    from rclpy.action import ActionClient

    rclpy.init()
    node = rclpy.create_node("waiter")
    client = node.create_client(AddTwoInts, "served_by_nobody")
    action_client = ActionClient(node, Fibonacci, "done_by_nobody")
    waits = {"/served_by_nobody": client.wait_for_service, "done_by_nobody": action_client.wait_for_server}
    for wait in waits.values():
        assert not wait(timeout_sec=0)
    node.context._end_by_signal()  # as SIGTERM does: the program still has its node
    for name, wait in waits.items():
        with pytest.raises(RCLError, match=f"whether {name} is served: the context is shut down"):
            wait(timeout_sec=1.0)
