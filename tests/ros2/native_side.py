"""Our own nodes as a participant."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

import metaros
from metaros.idl import message_class
from metaros.idl.json import from_json, to_json
from metaros.interfaces.example_interfaces.action import Fibonacci
from metaros.interfaces.example_interfaces.srv import AddTwoInts
from metaros.interfaces.lifecycle_msgs.srv import ChangeState, GetState
from metaros.interfaces.std_msgs.msg import String
from metaros.interfaces.std_srvs.srv import Trigger
from metaros.interfaces.type_description_interfaces.srv import GetTypeDescription
from metaros.node import ServerGoal
from metaros.wire import Durability, QoSProfile, Reliability, qos_rosout, qos_transient_local
from tests.ros2.participant import PATIENT, SPEED, Fields, GoalRun, Seen, fibonacci
from tests.support.waiting import wait_until

__all__ = ["NativeSide"]

WAIT_S = 60.0


class NativeSide:
    """A node and a lifecycle node, spun on a thread."""

    def __init__(self, router: str, name: str = "native") -> None:
        self.name = name
        self._context = metaros.Context(domain_id=0, connect=router, environ={})
        self.node = metaros.Node(name, context=self._context)
        self.node.declare_parameter("speed", SPEED, minimum=0.0, maximum=1.0)
        self.node.create_service(AddTwoInts, "~/add", self._add)
        self.node.create_action_server(Fibonacci, "~/fibonacci", _execute, goal=_accept)
        self._clocked = metaros.Node(f"{name}_clocked", context=self._context, use_sim_time=True)
        for node in (self.node, self._clocked):
            node.create_service(Trigger, "~/now", partial(_now, node))
        self._managed = metaros.LifecycleNode(f"{name}_managed", context=self._context)
        self._executor = metaros.SingleThreadedExecutor()
        for node in (self.node, self._managed, self._clocked):
            self._executor.add_node(node)
        self._thread = threading.Thread(target=self._executor.spin)
        self._thread.start()
        self._made: list[Any] = []
        self._clients: dict[str, Any] = {}

    def _add(self, request: Any, response: Any) -> None:
        response.sum = request.a + request.b
        self.node.get_logger().info(f"{request.a} + {request.b}")

    @contextmanager
    def lending(self) -> Iterator[None]:
        """See `Participant`."""
        yield
        self._clients.clear()
        while self._made:
            self._made.pop().close()

    def _keep(self, made: Any) -> Any:
        self._made.append(made)
        return made

    def speak(self, topic: str, type_name: str, fields: Fields, *, latched: bool = False) -> Callable[[], object]:
        """See `Participant`."""
        message = from_json(type_name, fields)
        qos = qos_transient_local if latched else 10
        publisher = self._keep(self.node.create_publisher(type(message), topic, qos))
        return lambda: publisher.publish(message)

    def listen(self, topic: str, type_name: str, *, latched: bool = False) -> Callable[[], list[Fields]]:
        """A type that is not known is asked for."""
        heard: list[Fields] = []
        cls = self.node.fetch_interface(type_name)
        qos = qos_rosout if topic == "/rosout" else qos_transient_local if latched else 10
        self._keep(self.node.create_subscription(cls, topic, lambda message: heard.append(to_json(message)), qos))
        return lambda: heard

    def relay(self, message_type: str, heard: str, told: str) -> None:
        """Publish on one topic what comes on another."""
        cls = message_class(message_type)
        publisher = self._keep(self.node.create_publisher(cls, told, 10))
        self._keep(self.node.create_subscription(cls, heard, publisher.publish, 10))

    def publish_with(self, topic: str, policies: dict[str, Any]) -> None:
        """A publisher whose policies are called as in ROS 2."""
        words: dict[str, Any] = {"reliability": Reliability, "durability": Durability}
        made = {key: words[key][value.upper()] if key in words else value for key, value in policies.items()}
        self._keep(self.node.create_publisher(String, topic, QoSProfile(**made)))

    def call(self, service_type: Any, name: str, request: Any) -> Any:
        """A client's call."""
        client = self._clients.get(name)
        if client is None:
            client = self._clients[name] = self._keep(self.node.create_client(service_type, name))
            assert client.wait_for_service(WAIT_S), name
        return client.call_future(request, WAIT_S).result(WAIT_S)

    def add(self, server: str, a: int, b: int) -> int:
        """See `Participant`."""
        return int(self.call(AddTwoInts, f"/{server}/add", AddTwoInts.Request(a=a, b=b)).sum)

    def now(self, server: str) -> int:
        """See `Participant`."""
        return int(self.call(Trigger, f"/{server}/now", Trigger.Request()).message)

    def run_goal(self, server: str, order: int, *, cancel: bool = False) -> GoalRun:
        """See `Participant`."""
        client = self.node.create_action_client(Fibonacci, f"/{server}/fibonacci")
        try:
            assert client.wait_for_server(WAIT_S)
            told: list[list[int]] = []
            goal = client.send_goal(
                Fibonacci.Goal(order=order), feedback=lambda message: told.append(message.sequence.tolist())
            ).wait()
            if not goal.accepted:
                return GoalRun("REJECTED")
            result = goal.result()
            if cancel:
                assert goal.cancel().wait()
            end = result.wait()
            return GoalRun(end.status.name, end.result.sequence.tolist(), told)
        finally:
            client.close()

    def parameters(self, node: str) -> dict[str, Any]:
        """See `Participant`."""
        return dict(self._parameters(node).dump(timeout_s=WAIT_S))

    def set_parameter(self, node: str, name: str, value: object) -> str | None:
        """See `Participant`."""
        result = self._parameters(node).set({name: value}, timeout_s=WAIT_S)[name]
        return None if result else result.reason

    def _parameters(self, node: str) -> Any:
        client = self._clients.get(f"{node} parameters")
        if client is None:
            client = self._keep(self.node.create_parameter_client(f"/{node}"))
            self._clients[f"{node} parameters"] = client
        assert client.wait(WAIT_S)
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
        return {node.full_name for node in self.node.graph.nodes()}

    def endpoints(self, topic: str) -> list[Seen]:
        """See `Participant`."""
        return [
            Seen(
                kind=info.kind,
                node=info.node_full_name,
                type_name=info.type_name,
                type_hash=info.type_hash,
                reliability=info.qos.reliability.name.lower(),
                durability=info.qos.durability.name.lower(),
                depth=info.qos.depth,
            )
            for info in self.node.graph.endpoints(topic)
            if info.kind in ("MP", "MS")
        ]

    def describe(self, node: str, type_name: str, type_hash: str) -> list[Fields]:
        """See `Participant`."""
        request = GetTypeDescription.Request(type_name=type_name, type_hash=type_hash, include_type_sources=False)
        answer = self.call(GetTypeDescription, f"/{node}/get_type_description", request)
        assert answer.successful, answer.failure_reason
        told = answer.type_description
        return [to_json(part) for part in (told.type_description, *told.referenced_type_descriptions)]

    def close(self) -> None:
        """See `Participant`."""
        self._executor.shutdown()
        self._thread.join()
        self.node.close()
        self._managed.close()
        self._clocked.close()
        self._context.close()


def _now(node: metaros.Node, _: Any, response: Any) -> None:
    response.success, response.message = True, str(node.clock.wall_ns())


def _accept(goal: Any) -> bool:
    return bool(goal.order >= 0)


def _execute(goal: ServerGoal) -> Any:
    told = fibonacci(min(goal.request.order, PATIENT))
    for sequence in told:
        goal.publish_feedback(Fibonacci.Feedback(sequence=sequence))
    result = Fibonacci.Result(sequence=told[-1])
    if goal.request.order > PATIENT:
        wait_until(lambda: goal.is_cancel_requested)
        goal.canceled(result)
        return None
    return result
