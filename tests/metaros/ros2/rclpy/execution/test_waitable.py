"""Waitables of a program's own, alone and on an executor."""

from __future__ import annotations

import threading
from typing import Any

import pytest

from metaros.ros2.rclpy.core.context import Context
from metaros.ros2.rclpy.core.node import Node
from metaros.ros2.rclpy.execution.callback_groups import MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup
from metaros.ros2.rclpy.execution.executors import MultiThreadedExecutor, SingleThreadedExecutor
from metaros.ros2.rclpy.execution.guard_condition import GuardCondition
from metaros.ros2.rclpy.execution.task import Future
from metaros.ros2.rclpy.execution.wait_set import WaitSet
from metaros.ros2.rclpy.execution.waitable import NumberOfEntities, Waitable
from metaros.ros2.rclpy.time.clock import Clock
from metaros.ros2.rclpy.time.clock_type import ClockType
from metaros.ros2.rclpy.time.timer import Timer
from metaros.ros2.rosidl.catalogue import interface
from tests.support.waiting import wait_until


def test_numbers_of_entities_add_up() -> None:
    one, two = NumberOfEntities(1, 2, 3, 4, 5, 6), NumberOfEntities(10, 20, 30, 40, 50, 60)
    assert repr(one + two) == "<NumberOfEntities(11, 22, 33, 44, 55, 66)>"
    one += two
    assert (one.num_subscriptions, one.num_guard_conditions, one.num_timers) == (11, 22, 33)
    assert (one.num_clients, one.num_services, one.num_events) == (44, 55, 66)


def test_a_waitable_has_to_say_what_it_does() -> None:
    group = ReentrantCallbackGroup()
    waitable: Waitable[Any] = Waitable(group)
    assert group.has_entity(waitable)
    with waitable:
        pass
    for ask in (
        lambda: waitable.is_ready(None),
        waitable.take_data,
        waitable.get_num_entities,
        lambda: waitable.add_to_wait_set(None),
        lambda: waitable.execute(None).send(None),
    ):
        with pytest.raises(NotImplementedError, match="subclass"):
            ask()


class Own(Waitable[str]):
    """Waits for one entity of any kind."""

    def __init__(self, kind: str, entity: Any, group: Any = None) -> None:
        super().__init__(group or ReentrantCallbackGroup())
        self.kind, self.entity, self.index = kind, entity, -1
        self.done = Future[str]()
        self.add_future(self.done)

    def get_num_entities(self) -> NumberOfEntities:
        """One of them."""
        return NumberOfEntities(num_gcs=1)

    def add_to_wait_set(self, wait_set: WaitSet) -> None:
        """Remember where."""
        self.index = getattr(wait_set, f"add_{self.kind}")(self.entity)

    def is_ready(self, wait_set: WaitSet) -> bool:
        """When the entity is."""
        return wait_set.is_ready(self.kind, self.index)

    def take_data(self) -> str:
        """A timer is called."""
        if self.kind == "timer":
            self.entity.handle.call_timer()
        return self.kind

    async def execute(self, taken_data: str) -> None:
        """Say so."""
        self.done.set_result(taken_data)


def test_a_message_that_comes_amid_the_look_is_seen_by_who_waits_for_it(
    node: Node, executor: SingleThreadedExecutor
) -> None:
    string = interface("std_msgs/msg/String")
    executor.add_node(node)
    subscription = node.create_subscription(string, "amid", lambda message: None, 10)
    publisher = node.create_publisher(string, "amid", 10)

    class Late(Own):
        """Its message comes when it has just been asked in vain."""

        came = False

        def is_ready(self, wait_set: WaitSet) -> bool:
            if not self.came:
                self.came = True
                publisher.publish(string())
                return False
            return super().is_ready(wait_set)

    waitable = Late("subscription", subscription)
    node.add_waitable(waitable)
    executor.spin_until_future_complete(waitable.done, 5)
    assert waitable.done.result() == "subscription"


def test_mail_is_not_lost_where_a_waitable_fails(node: Node, executor: SingleThreadedExecutor) -> None:
    string = interface("std_msgs/msg/String")
    executor.add_node(node)
    heard: list[str] = []
    node.create_subscription(string, "kept", lambda message: heard.append(message.data), 10)
    publisher = node.create_publisher(string, "kept", 10)
    waitable = Own("nothing", None)  # a wait set has no such kind
    node.add_waitable(waitable)
    publisher.publish(string(data="here"))
    with pytest.raises(AttributeError, match="add_nothing"):
        executor.spin_once(1)
    node.remove_waitable(waitable)
    executor.spin_once(5)
    assert heard == ["here"]


def test_a_waitable_is_run_when_what_it_waits_for_is_ready(
    node: Node, executor: SingleThreadedExecutor, rclpy_context: Context
) -> None:
    string, trigger = interface("std_msgs/msg/String"), interface("std_srvs/srv/Trigger")
    executor.add_node(node)
    guard = GuardCondition(None, None, context=rclpy_context)
    timer = Timer(None, None, 1_000_000, Clock(clock_type=ClockType.STEADY_TIME), context=rclpy_context)
    subscription = node.create_subscription(string, "waited", lambda message: None, 10)
    publisher = node.create_publisher(string, "waited", 10)
    service = node.create_service(trigger, "waited", lambda request, response: response)
    client = node.create_client(trigger, "waited")
    cases = {
        "guard_condition": (guard.handle, guard.trigger),
        "timer": (timer, lambda: None),
        "subscription": (subscription, lambda: publisher.publish(string())),
        "service": (service.handle, lambda: client.call_async(trigger.Request())),
    }
    for kind, (entity, begin) in cases.items():
        waitable = Own(kind, entity)
        node.add_waitable(waitable)
        thread = threading.Thread(target=executor.spin_until_future_complete, args=(waitable.done, 5), daemon=True)
        thread.start()
        wait_until(lambda waitable=waitable: executor._asleep or waitable.done.done())  # type: ignore[misc]
        begin()
        thread.join(5)
        assert waitable.done.result() == kind
        assert waitable.done._living_executor() is executor
        node.remove_waitable(waitable)
    with pytest.raises(ValueError, match="no kind of entity"):
        WaitSet().is_ready("wish", 0)


def test_each_trigger_is_answered_once(node: Node, pool: MultiThreadedExecutor, rclpy_context: Context) -> None:
    pool.add_node(node)
    guard = GuardCondition(None, None, context=rclpy_context)
    runs = list[str]()

    class Counts(Own):
        async def execute(self, taken_data: str) -> None:
            runs.append(taken_data)

    node.add_waitable(Counts("guard_condition", guard, MutuallyExclusiveCallbackGroup()))
    for count in (1, 2):
        guard.trigger()
        for _ in range(3):
            pool.spin_once(timeout_sec=0.001)
        wait_until(lambda count=count: len(runs) == count)  # type: ignore[misc]


def test_ready_entities_are_told_by_their_pointers(rclpy_context: Context) -> None:
    wait_set = WaitSet(0, 2, 0, 0, 0, 0, None)
    guards = [GuardCondition(None, None, context=rclpy_context) for _ in range(2)]
    for guard in guards:
        wait_set.add_guard_condition(guard.handle)
    guards[1].trigger()
    assert wait_set.look() is None
    assert wait_set.get_ready_entities("guard_condition") == [guards[1].handle.pointer]
    wait_set.look()
    assert wait_set.get_ready_entities("guard_condition") == []
    wait_set.clear_entities()
    assert not wait_set.is_ready("guard_condition", 1)
