"""Action clients of the rclpy face, against a server made of plain services and publishers."""

from __future__ import annotations

import weakref
from collections.abc import Iterator
from typing import Any

import pytest

from metaros.ros2.rclpy.action.client import ActionClient
from metaros.ros2.rclpy.core.rcl_errors import InvalidHandle
from metaros.ros2.rclpy.core.service_introspection import ServiceIntrospectionState
from metaros.ros2.rclpy.execution.callback_groups import ReentrantCallbackGroup
from metaros.ros2.rclpy.names.exceptions import InvalidTopicNameException
from metaros.ros2.rclpy.qos.profile import QoSProfile, qos_profile_action_status_default, qos_profile_system_default
from metaros.ros2.rosidl.catalogue import interface
from tests.metaros.ros2.rclpy.action.conftest import Spun

STATUS = interface("action_msgs/msg/GoalStatus")


class PlainServer:
    """The five endpoints of /fib, without an action server behind them."""

    def __init__(self, node: Any, fibonacci: Any) -> None:
        impl, prefix = fibonacci.Impl, "/fib/_action"
        self.impl = impl
        self.accepts = True
        node.create_service(impl.SendGoalService, f"{prefix}/send_goal", self.goal)
        node.create_service(impl.CancelGoalService, f"{prefix}/cancel_goal", self.cancel)
        node.create_service(impl.GetResultService, f"{prefix}/get_result", self.result)
        self.feedback = node.create_publisher(impl.FeedbackMessage, f"{prefix}/feedback", 1)
        self.status = node.create_publisher(
            impl.GoalStatusMessage, f"{prefix}/status", qos_profile_action_status_default
        )

    def goal(self, request: Any, response: Any) -> Any:
        response.accepted = self.accepts
        return response

    def cancel(self, request: Any, response: Any) -> Any:
        response.goals_canceling.append(request.goal_info)
        return response

    def result(self, request: Any, response: Any) -> Any:
        self.tell_feedback(request.goal_id, 7)
        response.status = STATUS.STATUS_SUCCEEDED
        response.result.sequence = [1, 1, 2]
        return response

    def tell_feedback(self, goal_id: Any, number: int) -> None:
        message = self.impl.FeedbackMessage()
        message.goal_id, message.feedback.sequence = goal_id, [number]
        self.feedback.publish(message)

    def tell_status(self, goal_id: Any, status: int) -> None:
        entry = STATUS(status=status)
        entry.goal_info.goal_id = goal_id
        self.status.publish(self.impl.GoalStatusMessage(status_list=[entry]))


@pytest.fixture
def server(spun: Spun, fibonacci: Any) -> PlainServer:
    """On the same node."""
    return PlainServer(spun.node, fibonacci)


@pytest.fixture
def client(spun: Spun, fibonacci: Any) -> Iterator[ActionClient]:
    """Of /fib."""
    client = ActionClient(spun.node, fibonacci, "fib")
    yield client
    client.destroy()


def test_construction_and_what_is_refused(spun: Spun, fibonacci: Any) -> None:
    profiles = {
        f"{part}_qos_profile": QoSProfile(depth=3)
        for part in ("goal_service", "result_service", "cancel_service", "feedback_sub", "status_sub")
    }
    client = ActionClient(spun.node, fibonacci, "fib", callback_group=ReentrantCallbackGroup(), **profiles)
    assert client in list(spun.node.waitables)
    assert (client.get_num_entities().num_clients, client.get_num_entities().num_subscriptions) == (3, 2)
    client.destroy()
    client.destroy()
    assert client not in list(spun.node.waitables)
    assert spun.node.handle.graph.endpoints("/fib/_action/send_goal", "SC") == []
    with pytest.raises(InvalidHandle):
        client.send_goal_async(fibonacci.Goal())
    with pytest.raises(AttributeError, match="is no message or service"):
        ActionClient(spun.node, dict, "fib")
    with pytest.raises(RuntimeError, match="is no action"):
        ActionClient(spun.node, interface("std_msgs/msg/String"), "fib")
    with pytest.raises(InvalidTopicNameException):
        ActionClient(spun.node, fibonacci, "no name")
    assert ActionClient[int, int, int].__origin__ is ActionClient


def test_a_server_is_waited_for(spun: Spun, client: ActionClient, fibonacci: Any) -> None:
    assert not client.wait_for_server(0.0)
    assert not client.server_is_ready()
    future = client.send_goal_async(fibonacci.Goal())
    spun.calm()
    assert not future.done()
    PlainServer(spun.node, fibonacci)
    assert client.wait_for_server(20.0)
    assert client.server_is_ready()


def test_a_goal_from_its_handle_to_its_result(
    spun: Spun, client: ActionClient, server: PlainServer, fibonacci: Any
) -> None:
    client.wait_for_server()
    heard: list[int] = []
    goal = client.send_goal_async(
        fibonacci.Goal(order=1), feedback_callback=lambda message: heard.append(message.feedback.sequence[0])
    )
    handle = spun.until(goal)
    assert handle.accepted
    assert handle.status == STATUS.STATUS_UNKNOWN
    assert repr(handle).startswith("ClientGoalHandle <id=[")
    server.tell_feedback(handle.goal_id, 5)
    server.tell_feedback(interface("unique_identifier_msgs/msg/UUID")(), 6)  # of nobody's goal
    server.tell_status(handle.goal_id, STATUS.STATUS_EXECUTING)
    spun.while_not(lambda: heard and handle.status == STATUS.STATUS_EXECUTING)
    response = spun.until(handle.get_result_async())
    assert (response.status, list(response.result.sequence)) == (STATUS.STATUS_SUCCEEDED, [1, 1, 2])
    assert heard == [5, 7]  # what was told just before the result is heard before it
    server.tell_feedback(handle.goal_id, 8)
    server.tell_status(handle.goal_id, STATUS.STATUS_SUCCEEDED)
    spun.while_not(lambda: handle.status == STATUS.STATUS_SUCCEEDED)
    spun.calm()
    assert heard == [5, 7]
    assert client._goal_handles == {}


def test_feedback_by_a_coroutine_function_and_a_goal_id_of_ones_own(
    spun: Spun, client: ActionClient, server: PlainServer, fibonacci: Any
) -> None:
    client.wait_for_server()
    heard: list[Any] = []

    async def on_feedback(message: Any) -> None:
        heard.append(message.goal_id)

    goal_id = interface("unique_identifier_msgs/msg/UUID")(uuid=list(range(16)))
    server.tell_feedback(goal_id, 1)  # before anybody cares
    spun.calm()
    handle = spun.until(client.send_goal_async(fibonacci.Goal(), on_feedback, goal_uuid=goal_id))
    assert heard == []
    server.tell_feedback(goal_id, 2)
    spun.while_not(lambda: heard)
    assert heard == [goal_id] == [handle.goal_id]


def test_a_status_that_overtakes_the_answer(
    spun: Spun, client: ActionClient, server: PlainServer, fibonacci: Any
) -> None:
    client.wait_for_server()
    goal_id = interface("unique_identifier_msgs/msg/UUID")(uuid=list(range(16)))
    server.tell_status(goal_id, STATUS.STATUS_SUCCEEDED)  # of a goal that took no time
    spun.while_not(lambda: client._statuses)
    handle = spun.until(client.send_goal_async(fibonacci.Goal(), goal_uuid=goal_id))
    assert handle.status == STATUS.STATUS_SUCCEEDED
    assert client._goal_handles == {}


def test_several_goals_a_cancel_and_a_refusal(
    spun: Spun, client: ActionClient, server: PlainServer, fibonacci: Any
) -> None:
    client.wait_for_server()
    handles = [spun.until(future) for future in [client.send_goal_async(fibonacci.Goal()) for _ in range(3)]]
    assert len({bytes(handle.goal_id.uuid) for handle in handles}) == 3
    assert handles[0] != handles[1]
    assert handles[0] == handles[0]
    canceled = spun.until(handles[0].cancel_goal_async())
    assert [info.goal_id for info in canceled.goals_canceling] == [handles[0].goal_id]
    server.accepts = False
    assert not spun.until(client.send_goal_async(fibonacci.Goal(), lambda message: None)).accepted
    assert client._feedback_callbacks == {}
    forgotten = weakref.ref(handles.pop())
    assert forgotten() is None


def test_what_is_no_goal(client: ActionClient) -> None:
    for call in (client.send_goal, client.send_goal_async):
        with pytest.raises(TypeError, match="Expected <class 'example_interfaces"):
            call("no goal")
    for ask in (client._cancel_goal_async, client._get_result_async):
        with pytest.raises(TypeError, match="ClientGoalHandle"):
            ask("no handle")  # type: ignore[arg-type]


def test_calls_that_wait(in_background: Spun, client: ActionClient, server: PlainServer, fibonacci: Any) -> None:
    client.wait_for_server()
    assert list(client.send_goal(fibonacci.Goal()).result.sequence) == [1, 1, 2]
    handle = client._accepted(*_sent(client, fibonacci))
    assert list(handle.get_result().result.sequence) == [1, 1, 2]
    assert handle.cancel_goal().goals_canceling[0].goal_id == handle.goal_id


def _sent(client: ActionClient, fibonacci: Any) -> tuple[Any, Any]:
    request = client._goal_request(fibonacci.Goal())
    return request, client._goal_client.call(request)


def test_introspection(spun: Spun, client: ActionClient, server: PlainServer, fibonacci: Any) -> None:
    events: list[Any] = []
    event = fibonacci.Impl.SendGoalService.Event
    spun.node.create_subscription(event, "/fib/_action/send_goal/_service_event", events.append, 3)
    client.wait_for_server()
    spun.until(client.send_goal_async(fibonacci.Goal()))
    client.configure_introspection(
        spun.node.get_clock(), qos_profile_system_default, ServiceIntrospectionState.CONTENTS
    )
    spun.until(client.send_goal_async(fibonacci.Goal(order=4)))
    spun.while_not(lambda: len(events) == 2)
    assert events[0].info.event_type == events[0].info.REQUEST_SENT
    assert events[0].request[0].goal.order == 4
    assert events[1].response[0].accepted
