"""Action servers of the rclpy face, asked by plain service clients: what is on the wire counts."""

from __future__ import annotations

import threading
import uuid
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from metaros.ros2.rclpy.action.goal_handle import GoalEvent, ServerGoalHandle
from metaros.ros2.rclpy.action.responses import CancelResponse, GoalResponse
from metaros.ros2.rclpy.action.server import ActionServer
from metaros.ros2.rclpy.core.context import Context
from metaros.ros2.rclpy.core.rcl_errors import RCLError
from metaros.ros2.rclpy.core.service_introspection import ServiceIntrospectionState
from metaros.ros2.rclpy.execution.callback_groups import ReentrantCallbackGroup
from metaros.ros2.rclpy.execution.executors import SingleThreadedExecutor
from metaros.ros2.rclpy.execution.task import Future
from metaros.ros2.rclpy.parameters.value import Parameter
from metaros.ros2.rclpy.qos.profile import QoSProfile, qos_profile_system_default
from metaros.ros2.rclpy.time.clock import ROSClock
from metaros.ros2.rclpy.time.time import Time
from metaros.ros2.rosidl.catalogue import interface
from tests.metaros.ros2.rclpy.action.conftest import WAIT_S, Spun

STATUS = interface("action_msgs/msg/GoalStatus")
CANCEL = interface("action_msgs/srv/CancelGoal")


class PlainClient:
    """Clients and subscriptions of /fib, without an action client around them."""

    def __init__(self, spun: Spun, fibonacci: Any) -> None:
        node, impl, prefix = spun.node, fibonacci.Impl, "/fib/_action"
        self.spun, self.impl = spun, impl
        self.goals = node.create_client(impl.SendGoalService, f"{prefix}/send_goal")
        self.cancels = node.create_client(impl.CancelGoalService, f"{prefix}/cancel_goal")
        self.results = node.create_client(impl.GetResultService, f"{prefix}/get_result")
        self.feedback: list[list[int]] = []
        self.status: dict[bytes, int] = {}
        node.create_subscription(impl.FeedbackMessage, f"{prefix}/feedback", self._on_feedback, 10)
        node.create_subscription(impl.GoalStatusMessage, f"{prefix}/status", self._on_status, 1)

    def _on_feedback(self, message: Any) -> None:
        self.feedback.append(list(message.feedback.sequence))

    def _on_status(self, message: Any) -> None:
        self.status = {bytes(entry.goal_info.goal_id.uuid): entry.status for entry in message.status_list}

    def ask(self, order: int = 0, goal_id: Any = None) -> tuple[Any, Any]:
        """Send a goal: its id, and the future of the answer."""
        request = self.impl.SendGoalService.Request()
        request.goal_id = new_id() if goal_id is None else goal_id
        request.goal.order = order
        return request.goal_id, self.goals.call_async(request)

    def send(self, order: int = 0, goal_id: Any = None) -> Any:
        """The same, and wait for the answer; the id of a goal that was accepted, else None."""
        goal_id, future = self.ask(order, goal_id)
        return goal_id if self.spun.until(future).accepted else None

    def cancel(self, goal_id: Any) -> Any:
        """The answer to a request to cancel it."""
        request = CANCEL.Request()
        request.goal_info.goal_id = goal_id
        return self.spun.until(self.cancels.call_async(request))

    def result(self, goal_id: Any) -> tuple[int, list[int]]:
        """How it ended."""
        response = self.spun.until(self.results.call_async(self.impl.GetResultService.Request(goal_id=goal_id)))
        return response.status, list(response.result.sequence)


def new_id() -> Any:
    return interface("unique_identifier_msgs/msg/UUID")(uuid=list(uuid.uuid4().bytes))


@pytest.fixture
def client(spun: Spun, fibonacci: Any) -> PlainClient:
    """On the server's node."""
    return PlainClient(spun, fibonacci)


Serve = Callable[..., ActionServer]


@pytest.fixture
def serve(spun: Spun, fibonacci: Any, client: PlainClient) -> Iterator[Serve]:
    """Make the server of /fib."""
    made: list[ActionServer] = []

    def make(*args: Any, **options: Any) -> ActionServer:
        made.append(ActionServer(spun.node, fibonacci, "fib", *args, **options))
        assert client.goals.wait_for_service(20.0)
        assert client.results.wait_for_service(20.0)
        return made[0]

    yield make
    for server in made:
        server.destroy()


def result_of(fibonacci: Any, *numbers: int) -> Any:
    return fibonacci.Result(sequence=list(numbers))


def test_construction(spun: Spun, fibonacci: Any, serve: Serve) -> None:
    profiles = {
        f"{part}_qos_profile": QoSProfile(depth=3)
        for part in ("goal_service", "result_service", "cancel_service", "feedback_pub", "status_pub")
    }
    server = serve(lambda goal: None, callback_group=ReentrantCallbackGroup(), result_timeout=300, **profiles)
    entities = server.get_num_entities()
    assert (entities.num_services, entities.num_timers, entities.num_subscriptions) == (3, 1, 0)
    assert server in list(spun.node.waitables)
    assert server.action_type is fibonacci
    assert [event.name for event in GoalEvent] == ["EXECUTE", "CANCEL_GOAL", "SUCCEED", "ABORT", "CANCELED"]
    with pytest.raises(TypeError, match="not callable"):
        server.register_execute_callback("nothing")  # type: ignore[arg-type]
    server.destroy()
    assert spun.node.handle.graph.endpoints("/fib/_action/send_goal", "SS") == []
    assert server not in list(spun.node.waitables)


def test_a_goal_from_its_request_to_its_result(fibonacci: Any, client: PlainClient, serve: Serve) -> None:
    seen: list[Any] = []

    def accepts(goal: Any) -> GoalResponse:
        seen.append(goal.order)
        return GoalResponse.ACCEPT

    def execute(goal_handle: ServerGoalHandle) -> Any:
        seen.append((goal_handle.status, goal_handle.request.order, goal_handle.is_active))
        with pytest.raises(TypeError, match="Expected"):
            goal_handle.publish_feedback("no feedback")
        goal_handle.publish_feedback(fibonacci.Feedback(sequence=[1, 1]))
        goal_handle.succeed()
        return result_of(fibonacci, 1, 1, 2)

    serve(execute, goal_callback=accepts)
    goal_id = client.send(5)
    assert client.result(goal_id) == (STATUS.STATUS_SUCCEEDED, [1, 1, 2])
    assert client.result(goal_id) == (STATUS.STATUS_SUCCEEDED, [1, 1, 2])  # it is kept
    assert seen == [5, (STATUS.STATUS_EXECUTING, 5, True)]
    client.spun.while_not(lambda: client.feedback and client.status.get(bytes(goal_id.uuid)) == 4)
    assert client.feedback == [[1, 1]]
    assert client.result(new_id()) == (STATUS.STATUS_UNKNOWN, [])


def test_on_one_thread_what_an_execute_callback_tells_is_heard_before_the_answer_to_its_goal(
    rclpy_context: Context, fibonacci: Any, spun: Spun, client: PlainClient, serve: Serve
) -> None:
    def execute(goal_handle: ServerGoalHandle) -> Any:
        goal_handle.publish_feedback(fibonacci.Feedback(sequence=[goal_handle.request.order]))
        goal_handle.succeed()
        return fibonacci.Result()

    serve(execute)
    with SingleThreadedExecutor(context=rclpy_context) as executor:
        executor.add_node(spun.node)
        for order in range(10):
            executor.spin_until_future_complete(client.ask(order)[1], WAIT_S)
            assert client.feedback[order:] == [[order]]


def test_goals_that_are_not_accepted(client: PlainClient, serve: Serve, capfd: pytest.CaptureFixture[str]) -> None:
    server = serve(lambda goal_handle: None, handle_accepted_callback=lambda goal_handle: None)
    server.register_goal_callback(lambda goal: GoalResponse.REJECT)
    assert client.send() is None
    server.register_goal_callback(lambda goal: "yes")
    assert client.send() is None
    assert "did not return a GoalResponse" in capfd.readouterr().err
    server.register_goal_callback(None)
    first = client.send()
    assert first is not None
    assert client.send(goal_id=first) is None  # its id is taken
    assert len(server._goal_handles) == 1


def test_how_an_execute_callback_may_end(
    fibonacci: Any, client: PlainClient, serve: Serve, capfd: pytest.CaptureFixture[str]
) -> None:
    def execute(goal_handle: ServerGoalHandle) -> Any:
        match goal_handle.request.order:
            case 1:
                goal_handle.abort()
            case 2:
                raise RuntimeError("it broke")
            case 3:
                goal_handle.succeed()
                with pytest.raises(RCLError, match="SUCCEEDED takes no ABORT"):
                    goal_handle.abort()
                with pytest.raises(RCLError, match="takes no EXECUTE"):
                    goal_handle.execute()
                return "no result"
            case 4:
                goal_handle.succeed(result_of(fibonacci, 4, 4))
                return result_of(fibonacci, 5)
            case 5:
                with pytest.raises(RCLError, match="EXECUTING takes no CANCELED"):
                    goal_handle.canceled()
        return result_of(fibonacci, 9)

    serve(execute)
    aborted, succeeded = STATUS.STATUS_ABORTED, STATUS.STATUS_SUCCEEDED
    ends = {1: (aborted, [9]), 2: (aborted, []), 3: (succeeded, []), 4: (succeeded, [4, 4]), 5: (aborted, [9])}
    assert {order: client.result(client.send(order)) for order in ends} == ends
    said = capfd.readouterr().err
    for words in ("Error raised in execute callback: it broke", "Goal state not set, assuming aborted", "no Result"):
        assert words in said


def test_callbacks_that_await(spun: Spun, fibonacci: Any, client: PlainClient, serve: Serve) -> None:
    go_on: Future[int] = Future()

    async def accepts(goal: Any) -> GoalResponse:
        return GoalResponse.ACCEPT

    async def execute(goal_handle: ServerGoalHandle) -> Any:
        number = await go_on
        goal_handle.succeed()
        return result_of(fibonacci, number or 0)

    serve(execute, goal_callback=accepts)
    ids = [client.send(), client.send()]
    futures = [client.results.call_async(client.impl.GetResultService.Request(goal_id=goal_id)) for goal_id in ids]
    spun.calm()
    assert not any(future.done() for future in futures)
    go_on.set_result(7)
    assert [list(spun.until(future).result.sequence) for future in futures] == [[7], [7]]


def test_cancels(spun: Spun, fibonacci: Any, client: PlainClient, serve: Serve) -> None:
    kept: list[ServerGoalHandle] = []
    verdicts = [CancelResponse.REJECT, CancelResponse.ACCEPT]

    def execute(goal_handle: ServerGoalHandle) -> Any:
        assert goal_handle.is_cancel_requested
        goal_handle.canceled()
        return result_of(fibonacci, 3)

    server = serve(execute, handle_accepted_callback=kept.append, cancel_callback=lambda goal_handle: verdicts.pop(0))
    goal_id = client.send()
    refused = client.cancel(goal_id)
    assert (refused.return_code, list(refused.goals_canceling)) == (CANCEL.Response.ERROR_REJECTED, [])
    accepted = client.cancel(goal_id)
    assert [info.goal_id for info in accepted.goals_canceling] == [goal_id]
    assert kept[0].status == STATUS.STATUS_CANCELING
    assert kept[0].goal_id == goal_id
    kept[0].execute()
    assert client.result(goal_id) == (STATUS.STATUS_CANCELED, [3])
    assert client.cancel(goal_id).return_code == CANCEL.Response.ERROR_GOAL_TERMINATED
    assert client.cancel(new_id()).return_code == CANCEL.Response.ERROR_UNKNOWN_GOAL_ID
    server.register_cancel_callback(None)
    assert client.cancel(client.send()).return_code == CANCEL.Response.ERROR_REJECTED


def test_a_cancel_gets_through_while_a_plain_callback_runs(fibonacci: Any, client: PlainClient, serve: Serve) -> None:
    canceled = threading.Event()

    def execute(goal_handle: ServerGoalHandle) -> Any:
        assert canceled.wait(20.0)
        goal_handle.canceled()
        return fibonacci.Result()

    def agree(goal_handle: ServerGoalHandle) -> CancelResponse:
        return CancelResponse.ACCEPT

    serve(execute, cancel_callback=agree)  # in the node's own group, which excludes
    goal_id = client.send()
    assert len(client.cancel(goal_id).goals_canceling) == 1
    canceled.set()
    assert client.result(goal_id) == (STATUS.STATUS_CANCELED, [])


def test_without_an_execute_callback(fibonacci: Any, client: PlainClient, serve: Serve) -> None:
    kept: list[ServerGoalHandle] = []

    def accepted(goal_handle: ServerGoalHandle) -> None:
        goal_handle.executing()
        kept.append(goal_handle)

    serve(handle_accepted_callback=accepted)
    goal_id = client.send()
    client.spun.while_not(lambda: kept)
    kept[0].succeed(result_of(fibonacci, 1, 2))
    assert client.result(goal_id) == (STATUS.STATUS_SUCCEEDED, [1, 2])


def test_results_are_forgotten(client: PlainClient, serve: Serve, fibonacci: Any) -> None:
    def execute(goal_handle: ServerGoalHandle) -> Any:
        goal_handle.succeed()
        return fibonacci.Result()

    server = serve(execute, result_timeout=0.2)
    ids = [client.send() for _ in range(3)]
    assert len(server._goal_handles) == 3
    client.spun.while_not(lambda: not server._goal_handles)
    client.spun.while_not(lambda: not client.status)
    assert client.result(ids[0])[0] == STATUS.STATUS_UNKNOWN


def test_results_are_forgotten_by_the_time_of_a_simulation(
    spun: Spun, client: PlainClient, serve: Serve, fibonacci: Any
) -> None:
    assert spun.node.set_parameters([Parameter("use_sim_time", value=True)])[0].successful
    clock = spun.node.get_clock()
    assert isinstance(clock, ROSClock)
    kept: list[ServerGoalHandle] = []

    def execute(goal_handle: ServerGoalHandle) -> Any:
        kept.append(goal_handle)
        goal_handle.succeed()
        return fibonacci.Result()

    server = serve(execute, result_timeout=10)
    goal_id = client.send()
    assert client.result(goal_id)[0] == kept[0].status == STATUS.STATUS_SUCCEEDED
    for seconds, left in ((9.999, 1), (10.0, 0)):
        clock.set_ros_time_override(Time(nanoseconds=int(seconds * 1e9), clock_type=clock.clock_type))
        assert len(server._goal_handles) == left
    assert kept[0].status == STATUS.STATUS_UNKNOWN


def test_what_a_goal_callback_raises_comes_out_of_spin_and_the_client_is_told(
    spun: Spun, client: PlainClient, serve: Serve
) -> None:
    def fails(goal: Any) -> GoalResponse:
        raise ValueError("no such goal")

    serve(lambda goal_handle: None, goal_callback=fails)
    _, future = client.ask()
    with pytest.raises(ValueError, match="no such goal"):
        spun.until(future)


def test_a_server_that_goes_leaves_nobody_waiting(spun: Spun, client: PlainClient, serve: Serve) -> None:
    server = serve(lambda goal_handle: None, handle_accepted_callback=lambda goal_handle: None)
    goal_id = client.send()
    handle = server._goal_handles[bytes(goal_id.uuid)]
    client.results.call_async(client.impl.GetResultService.Request(goal_id=goal_id))
    spun.while_not(lambda: server._wire.waiting("get_result"))
    server.destroy()
    server.destroy()
    assert server._wire.waiting("get_result") == 0
    assert (handle.status, handle.is_active) == (STATUS.STATUS_UNKNOWN, False)
    handle.succeed()  # as in rclpy: nothing
    handle.publish_feedback(server.action_type.Feedback())


def test_introspection(spun: Spun, client: PlainClient, serve: Serve, fibonacci: Any) -> None:
    events: list[Any] = []
    event = fibonacci.Impl.SendGoalService.Event
    spun.node.create_subscription(event, "/fib/_action/send_goal/_service_event", events.append, 3)
    server = serve(lambda goal_handle: None, goal_callback=lambda goal: GoalResponse.REJECT)
    client.send()
    clock = spun.node.get_clock()
    server.configure_introspection(clock, qos_profile_system_default, ServiceIntrospectionState.CONTENTS)
    client.send(4)
    spun.while_not(lambda: len(events) == 2)
    assert events[0].info.event_type == events[0].info.REQUEST_RECEIVED
    assert events[0].request[0].goal.order == 4
    assert not events[1].response[0].accepted
