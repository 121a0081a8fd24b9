"""Lifecycle nodes of rclpy's shape: transitions, what follows them, and how others see and change the state."""

from __future__ import annotations

import gc
import threading
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from metaros.ros2.rclpy.core.context import Context
from metaros.ros2.rclpy.core.publisher import Publisher
from metaros.ros2.rclpy.core.rcl_errors import RCLError
from metaros.ros2.rclpy.execution.executors import SingleThreadedExecutor
from metaros.ros2.rclpy.lifecycle import (
    LifecycleNode,
    LifecyclePublisher,
    LifecycleState,
    ManagedEntity,
    SimpleManagedEntity,
    TransitionCallbackReturn,
)
from metaros.ros2.rosidl.catalogue import interface
from tests.support.processes.command_line import call_metaros
from tests.support.waiting import wait_until

SUCCESS, FAILURE, ERROR = TransitionCallbackReturn
MakeNode = Callable[..., LifecycleNode]


class Told(LifecycleNode):
    """Answers as it is told, and notes what it was asked."""

    def __init__(self, name: str, **options: Any) -> None:
        self.answers: dict[str, Any] = {}
        self.asked: list[str] = []
        super().__init__(name, **options)

    def _answer(self, what: str, state: LifecycleState) -> Any:
        self.asked.append(f"{what} from {state.label}")
        answer = self.answers.get(what, SUCCESS)
        if isinstance(answer, Exception):
            raise answer
        return answer

    def on_configure(self, state: LifecycleState) -> Any:
        return self._answer("configure", state)

    def on_activate(self, state: LifecycleState) -> Any:
        return self._answer("activate", state)

    def on_error(self, state: LifecycleState) -> Any:
        return self._answer("error", state)


@pytest.fixture
def make(rclpy_context: Context) -> Iterator[MakeNode]:
    """Make nodes that the test's end destroys."""
    nodes: list[LifecycleNode] = []

    def make(kind: type[LifecycleNode] = LifecycleNode, name: str = "arm", **options: Any) -> Any:
        nodes.append(kind(name, context=rclpy_context, **options))
        return nodes[-1]

    yield make
    for node in nodes:
        node.destroy_node()


def spin_until(executor: SingleThreadedExecutor, condition: Callable[[], object]) -> None:
    def spun() -> object:
        executor.spin_once(timeout_sec=0.1)
        return condition()

    wait_until(spun)


def state_of(node: LifecycleNode) -> str:
    return node._state_machine.current_state[1]


def test_the_whole_way(make: MakeNode) -> None:
    node = make(enable_communication_interface=False)
    assert state_of(node) == "unconfigured"
    steps = (node.trigger_configure, node.trigger_activate, node.trigger_deactivate, node.trigger_cleanup)
    seen = [(step(), state_of(node))[1] for step in steps]
    assert seen == ["inactive", "active", "inactive", "unconfigured"]
    assert node.trigger_shutdown() is SUCCESS
    assert state_of(node) == "finalized"
    assert node.trigger_shutdown() is None
    with pytest.raises(RCLError, match="no transition 'activate' from finalized: nothing is possible"):
        node.trigger_activate()


def test_what_callbacks_return_decides(make: MakeNode) -> None:
    node: Any = make(Told, enable_communication_interface=False)
    node.answers |= {"configure": FAILURE}
    assert (node.trigger_configure(), state_of(node)) == (FAILURE, "unconfigured")
    node.answers |= {"configure": ERROR}
    assert (node.trigger_configure(), state_of(node)) == (ERROR, "unconfigured")
    assert node.asked == ["configure from unconfigured"] * 2 + ["error from unconfigured"]
    node.answers = {"activate": ValueError("broken arm"), "error": FAILURE}
    assert node.trigger_configure() is SUCCESS
    assert (node.trigger_activate(), state_of(node)) == (ERROR, "finalized")
    assert node.asked[-2:] == ["activate from inactive", "error from inactive"]


def test_an_answer_that_is_none_is_an_error(make: MakeNode, caplog: pytest.LogCaptureFixture) -> None:
    node: Any = make(Told, enable_communication_interface=False)
    node.answers |= {"configure": None}
    assert node.trigger_configure() is ERROR
    assert "on_configure must return a TransitionCallbackReturn, not None" in caplog.text


def test_entities_follow_in_their_order_up_to_the_first_that_does_not_succeed(make: MakeNode) -> None:
    node = make(enable_communication_interface=False)
    asked: list[str] = []

    class Entity(ManagedEntity):
        def __init__(self, name: str, answer: TransitionCallbackReturn = SUCCESS) -> None:
            self.name, self.answer = name, answer

        def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
            asked.append(self.name)
            return self.answer

    refusing = Entity("b", FAILURE)
    for entity in (Entity("a"), refusing, Entity("c")):
        node.add_managed_entity(entity)
    assert node.trigger_configure() is FAILURE
    refusing.answer = SUCCESS
    assert node.trigger_configure() is SUCCESS
    assert asked == ["a", "b", "a", "b", "c"]


def test_publishers_are_silent_unless_activated(make: MakeNode, capfd: pytest.CaptureFixture[str]) -> None:
    text = interface("std_msgs/msg/String")
    node = make(enable_communication_interface=False)
    publisher = node.create_lifecycle_publisher(text, "chatter", 10)
    assert isinstance(publisher, LifecyclePublisher)
    assert isinstance(publisher, Publisher)
    heard: list[str] = []
    node.create_subscription(text, "chatter", lambda message: heard.append(message.data), 10)
    wait_until(lambda: publisher.get_subscription_count() == 1)
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    publisher.publish(text(data="lost"))
    publisher.publish(text(data="lost, too"))
    assert capfd.readouterr().err.count("/chatter: not published, its lifecycle publisher is not activated") == 1
    node.trigger_configure()
    node.trigger_activate()
    activated = [publisher.is_activated]
    publisher.publish(text(data="heard"))
    spin_until(executor, lambda: heard)
    node.trigger_deactivate()
    activated.append(publisher.is_activated)
    assert activated == [True, False]
    executor.shutdown()
    assert heard == ["heard"]
    with pytest.raises(TypeError, match="takes no publisher_class"):
        node.create_lifecycle_publisher(text, "chatter", 10, publisher_class=Publisher)
    assert node.destroy_lifecycle_publisher(publisher)
    assert not node.destroy_lifecycle_publisher(publisher)
    assert node.trigger_activate() is SUCCESS


def test_methods_that_run_only_while_enabled() -> None:
    class Light(SimpleManagedEntity):
        @SimpleManagedEntity.when_enabled
        def level(self) -> int:
            return 7

        @SimpleManagedEntity.when_enabled(when_not_enabled=lambda: "dark")
        def state(self, what: str) -> str:
            return what

    light, state = Light(), LifecycleState("inactive", 2)
    assert (light.level(), light.state("on")) == (None, "dark")
    light.on_activate(state)
    assert (light.level(), light.state(what="on")) == (7, "on")
    assert Light.level.__name__ == "level"
    light.on_deactivate(state)
    assert light.level() is None
    assert TransitionCallbackReturn.FAILURE.to_label() == "transition_failure"


def test_a_node_that_nobody_has_any_more_leaves_the_graph(rclpy_context: Context) -> None:
    handle = LifecycleNode("forgotten", context=rclpy_context).handle
    gc.collect()
    wait_until(lambda: handle.closed)


def test_without_an_interface_nobody_sees_it(make: MakeNode, rclpy_context: Context) -> None:
    with pytest.raises(TypeError, match="must be True or False, not 'yes'"):
        LifecycleNode("refused", context=rclpy_context, enable_communication_interface="yes")  # type: ignore[arg-type]
    hidden = make(name="hidden", enable_communication_interface=False)
    seen = make(name="seen")
    assert hidden._state_machine.service_get_state is None
    assert not hasattr(hidden, "_service_change_state")
    assert seen._state_machine.service_get_state is not None
    assert hasattr(seen, "_service_change_state")
    found = {name for name, _ in seen.get_service_names_and_types()}
    assert "/seen/change_state" in found
    assert not {name for name in found if name.startswith("/hidden/") and "state" in name}


def test_the_command_line_sees_and_changes_it(make: MakeNode, ros2_router: str) -> None:
    node: Any = make(Told)
    events: list[str] = []
    event_type = interface("lifecycle_msgs/msg/TransitionEvent")
    watcher = make(name="watcher", enable_communication_interface=False)
    watcher.create_subscription(
        event_type, "/arm/transition_event", lambda event: events.append(event.goal_state.label), 10
    )
    executor = SingleThreadedExecutor(context=node.context)
    for each in (node, watcher):
        executor.add_node(each)
    thread = threading.Thread(target=executor.spin)
    thread.start()

    def run(*words: str) -> str:
        done = call_metaros("lifecycle", *words, METAROS_ZENOH_PORT=ros2_router)
        assert done.code == 0, done.err
        return done.out

    try:
        assert "unconfigured" in run("get", "/arm")
        assert "success" in run("set", "/arm", "configure")
        assert state_of(node) == "inactive"
        assert "activate" in run("list", "/arm")
        wait_until(lambda: events == ["configuring", "inactive"])
        assert call_metaros("lifecycle", "set", "/arm", "configure", METAROS_ZENOH_PORT=ros2_router).code
    finally:
        executor.shutdown()
        thread.join()
    assert node.asked == ["configure from unconfigured"]
