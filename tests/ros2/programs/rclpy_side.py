"""Our rclpy face as a participant: written as a program for ROS 2, which imports rclpy by name."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from action_msgs.msg import GoalStatus
from example_interfaces.action import Fibonacci
from example_interfaces.srv import AddTwoInts
from geometry_msgs.msg import Twist
from lifecycle_msgs.msg import TransitionEvent
from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.msg import Log, ParameterEvent
from rclpy.action import ActionClient
from rclpy.context import Context
from rclpy.executors import MultiThreadedExecutor
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from rosidl_runtime_py import message_to_ordereddict, set_message_fields
from rosidl_runtime_py.utilities import get_message
from sensor_msgs.msg import LaserScan
from std_msgs.msg import String
from std_srvs.srv import Trigger
from type_description_interfaces.srv import GetTypeDescription

from tests.ros2.participant import Fields, GoalRun, Seen
from tests.ros2.programs.robot import Clocked, Managed, Robot

TYPES: dict[str, Any] = {
    "geometry_msgs/msg/Twist": Twist,
    "lifecycle_msgs/msg/TransitionEvent": TransitionEvent,
    "rcl_interfaces/msg/Log": Log,
    "rcl_interfaces/msg/ParameterEvent": ParameterEvent,
    "rosgraph_msgs/msg/Clock": Clock,
    "sensor_msgs/msg/LaserScan": LaserScan,
    "std_msgs/msg/String": String,
}
STATUS = {getattr(GoalStatus, f"STATUS_{name}"): name for name in ("SUCCEEDED", "CANCELED", "ABORTED")}
WAIT_S = 60.0


def open_context(router: str) -> Context:
    """A context of its own; the face reads where the router is from the environment."""
    context = Context()
    context.init([])
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("METAROS_ZENOH_PORT", router.rpartition(":")[2])
        assert context.handle is not None  # opens the session
    return context


class RclpySide:
    """A robot and a managed node, spun on a thread; `context` is open."""

    def __init__(self, context: Context, name: str = "rclpy") -> None:
        self.name = name
        self.node = Robot(name, context=context)
        self._managed = Managed(f"{name}_managed", context=context)
        self._executor = MultiThreadedExecutor(num_threads=4, context=context)
        self._clocked = Clocked(f"{name}_clocked", context=context)
        for node in (self.node, self._managed, self._clocked):
            self._executor.add_node(node)
        self._thread = threading.Thread(target=self._executor.spin)
        self._thread.start()
        self._undo: list[Callable[[], object]] = []
        self._clients: dict[str, Any] = {}
        self._parameter_clients: dict[str, Any] = {}

    @contextmanager
    def lending(self) -> Iterator[None]:
        """See `Participant`."""
        yield
        self._clients.clear()
        while self._undo:
            self._undo.pop()()

    def speak(self, topic: str, type_name: str, fields: Fields, *, latched: bool = False) -> Callable[[], object]:
        """See `Participant`."""
        message = TYPES[type_name]()
        set_message_fields(message, fields)
        qos = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL) if latched else QoSProfile(depth=10)
        publisher = self.publisher(TYPES[type_name], topic, qos)
        return lambda: publisher.publish(message)

    def publisher(self, message_type: Any, topic: str, qos: Any) -> Any:
        """As rclpy makes it."""
        publisher = self.node.create_publisher(message_type, topic, qos)
        self._undo.append(lambda: self.node.destroy_publisher(publisher))
        return publisher

    def listen(self, topic: str, type_name: str, *, latched: bool = False) -> Callable[[], list[Fields]]:
        """See `Participant`."""
        heard: list[Fields] = []
        qos = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL) if latched else QoSProfile(depth=10)
        self.subscribe(TYPES[type_name], topic, lambda message: heard.append(message_to_ordereddict(message)), qos)
        return lambda: heard

    def subscribe(self, message_type: Any, topic: str, callback: Callable[[Any], object], qos: Any) -> None:
        """As rclpy does."""
        subscription = self.node.create_subscription(message_type, topic, callback, qos)
        self._undo.append(lambda: self.node.destroy_subscription(subscription))

    def relay(self, message_type: Any, heard: str, told: str) -> None:
        """Publish on one topic what comes on another."""
        self.subscribe(message_type, heard, self.publisher(message_type, told, 10).publish, 10)

    @staticmethod
    def message_type(name: str) -> Any:
        """The class, by its full name."""
        return get_message(name)

    def publish_with(self, topic: str, policies: dict[str, Any]) -> None:
        """A publisher whose policies are called as in ROS 2."""
        words: dict[str, Any] = {"reliability": ReliabilityPolicy, "durability": DurabilityPolicy}
        made = {key: words[key][value.upper()] if key in words else value for key, value in policies.items()}
        self.publisher(String, topic, QoSProfile(**made))

    def until(self, future: Any) -> Any:
        """Its result."""
        done = threading.Event()
        future.add_done_callback(lambda _: done.set())
        assert done.wait(WAIT_S), "no answer"
        return future.result()

    def call(self, service_type: Any, name: str, request: Any) -> Any:
        """A client's call."""
        client = self._clients.get(name)
        if client is None:
            client = self._clients[name] = self.node.create_client(service_type, name)
            self._undo.append(lambda: self.node.destroy_client(client))
            assert client.wait_for_service(timeout_sec=WAIT_S), name
        return self.until(client.call_async(request))

    def add(self, server: str, a: int, b: int) -> int:
        """See `Participant`."""
        return int(self.call(AddTwoInts, f"/{server}/add", AddTwoInts.Request(a=a, b=b)).sum)

    def now(self, server: str) -> int:
        """See `Participant`."""
        return int(self.call(Trigger, f"/{server}/now", Trigger.Request()).message)

    def run_goal(self, server: str, order: int, *, cancel: bool = False) -> GoalRun:
        """See `Participant`."""
        client = ActionClient(self.node, Fibonacci, f"/{server}/fibonacci")
        try:
            assert client.wait_for_server(timeout_sec=WAIT_S)
            told: list[list[int]] = []
            goal = self.until(
                client.send_goal_async(
                    Fibonacci.Goal(order=order), lambda message: told.append(list(message.feedback.sequence))
                )
            )
            if not goal.accepted:
                return GoalRun("REJECTED")
            result = goal.get_result_async()
            if cancel:
                assert len(self.until(goal.cancel_goal_async()).goals_canceling) == 1
            end = self.until(result)
            return GoalRun(STATUS[end.status], list(end.result.sequence), told)
        finally:
            client.destroy()

    def parameters(self, node: str) -> dict[str, Any]:
        """See `Participant`."""
        client = self._parameters(node)
        names = list(self.until(client.list_parameters()).result.names)
        values = self.until(client.get_parameters(names)).values
        return {name: parameter_value_to_python(value) for name, value in zip(names, values, strict=True)}

    def set_parameter(self, node: str, name: str, value: object) -> str | None:
        """See `Participant`."""
        (result,) = self.until(self._parameters(node).set_parameters([Parameter(name, value=value)])).results
        return None if result.successful else result.reason

    def _parameters(self, node: str) -> Any:
        client = self._parameter_clients.get(node)
        if client is None:
            client = self._parameter_clients[node] = AsyncParameterClient(self.node, node)
        assert client.wait_for_services(WAIT_S)
        return client

    def state(self, node: str) -> str:
        """See `Participant`."""
        return str(self.call(GetState, f"/{node}/get_state", GetState.Request()).current_state.label)

    def change_state(self, node: str, transition: str) -> bool:
        """See `Participant`."""
        request = ChangeState.Request()
        request.transition.label = transition
        return bool(self.call(ChangeState, f"/{node}/change_state", request).success)

    def nodes(self) -> set[str]:
        """See `Participant`."""
        return {f"{space.rstrip('/')}/{name}" for name, space in self.node.get_node_names_and_namespaces()}

    def endpoints(self, topic: str) -> list[Seen]:
        """See `Participant`."""
        publishers = [("MP", info) for info in self.node.get_publishers_info_by_topic(topic)]
        subscriptions = [("MS", info) for info in self.node.get_subscriptions_info_by_topic(topic)]
        return [
            Seen(
                kind=kind,
                node=f"{info.node_namespace.rstrip('/')}/{info.node_name}",
                type_name=info.topic_type,
                type_hash=str(info.topic_type_hash),
                reliability=info.qos_profile.reliability.name.lower(),
                durability=info.qos_profile.durability.name.lower(),
                depth=info.qos_profile.depth,
            )
            for kind, info in (*publishers, *subscriptions)
        ]

    def describe(self, node: str, type_name: str, type_hash: str) -> list[Fields]:
        """See `Participant`."""
        request = GetTypeDescription.Request(type_name=type_name, type_hash=type_hash, include_type_sources=False)
        answer = self.call(GetTypeDescription, f"/{node}/get_type_description", request)
        assert answer.successful, answer.failure_reason
        told = answer.type_description
        parts = [told.type_description, *told.referenced_type_descriptions]
        return [dict(message_to_ordereddict(part)) for part in parts]

    def close(self) -> None:
        """See `Participant`."""
        self._executor.shutdown()
        self._thread.join()
        self.node.destroy_node()
        self._managed.destroy_node()
        self._clocked.destroy_node()
