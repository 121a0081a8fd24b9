"""`ActionServer`: goals come in, run on the executor, and end with a result that is kept for a while.

Everything runs on the executor that spins the node, in the server's callback group; execute callbacks are tasks of the
executor without a group, as in rclpy, so that a cancel gets through while one runs on another thread, or awaits.
"""

from __future__ import annotations

import threading
import traceback
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from inspect import isawaitable
from types import GenericAlias
from typing import Any, Final

from metaros.errors import UsageError
from metaros.executor import Timer
from metaros.limits import LIMITS
from metaros.node.action.goal import CancelCode, GoalState, GoalTable
from metaros.node.action.types import ActionTypes, ns_of
from metaros.node.service import PendingRequest
from metaros.ros2.rclpy.action.goal_handle import GoalEvent, ServerGoalHandle
from metaros.ros2.rclpy.action.names import ActionNode, endpoint_names, uuid_bytes
from metaros.ros2.rclpy.action.responses import (
    CancelResponse,
    GoalResponse,
    default_cancel_callback,
    default_goal_callback,
    default_handle_accepted_callback,
)
from metaros.ros2.rclpy.action.server_endpoints import ServerEndpoints
from metaros.ros2.rclpy.core.rcl_errors import RCLError
from metaros.ros2.rclpy.core.service_introspection import ServiceIntrospectionState
from metaros.ros2.rclpy.execution.callback_groups import ReentrantCallbackGroup
from metaros.ros2.rclpy.execution.inbox import Inbox
from metaros.ros2.rclpy.execution.waitable import NumberOfEntities, Waitable
from metaros.ros2.rclpy.names.constants import S_TO_NS
from metaros.ros2.rclpy.qos.profile import (
    QoSProfile,
    qos_profile_action_status_default,
    qos_profile_services_default,
)
from metaros.ros2.rclpy.time.clock_state import Jump, Watcher

__all__ = [
    "ActionServer",
    "CancelResponse",
    "GoalEvent",
    "GoalResponse",
    "ServerGoalHandle",
    "default_cancel_callback",
    "default_goal_callback",
    "default_handle_accepted_callback",
]

_DONE_LISTED: Final = 32  # finished goals that the status topic still tells
_SOON_S: Final = 0.001
_FEEDBACK_QOS: Final = QoSProfile(depth=10)


class ActionServer(Waitable[Any]):
    """Runs `execute_callback(goal_handle)`, plain or `async def`, for the goals that `goal_callback(goal)` accepts.

    The callback ends the goal by `goal_handle.succeed()`, `abort()` or `canceled()`, and returns the Result; a goal
    that it leaves, or fails in, is aborted. `result_timeout` is in seconds, by the node's clock.
    """

    __class_getitem__: Any = classmethod(GenericAlias)
    _by_mail = True  # executors need not ask it: what comes for it is in mailboxes of the node

    def __init__(
        self,
        node: ActionNode,
        action_type: type[Any],
        action_name: str,
        execute_callback: Callable[[ServerGoalHandle], Any] | None = None,
        *,
        callback_group: Any = None,
        goal_callback: Callable[[Any], Any] | None = default_goal_callback,
        handle_accepted_callback: Callable[[ServerGoalHandle], Any] | None = default_handle_accepted_callback,
        cancel_callback: Callable[[ServerGoalHandle], Any] | None = default_cancel_callback,
        goal_service_qos_profile: QoSProfile = qos_profile_services_default,
        result_service_qos_profile: QoSProfile = qos_profile_services_default,
        cancel_service_qos_profile: QoSProfile = qos_profile_services_default,
        feedback_pub_qos_profile: QoSProfile = _FEEDBACK_QOS,
        status_pub_qos_profile: QoSProfile = qos_profile_action_status_default,
        result_timeout: float = 900,
    ) -> None:
        names = endpoint_names(node, action_type, action_name)
        super().__init__(node.default_callback_group if callback_group is None else callback_group)
        self._node = node
        self._action_type = action_type
        self._logger = node.get_logger().get_child("action_server")
        self._lock = threading.RLock()
        self._goals = GoalTable(keep_s=max(0.0, float(result_timeout)), limit=LIMITS.action_goals)
        self._goal_handles: dict[bytes, ServerGoalHandle] = {}
        self._timer: Timer | None = None
        self._clock_state = node.get_clock().handle
        self._destroyed = False
        self._execute_callback: Callable[[ServerGoalHandle], Any] | None = None
        self.register_handle_accepted_callback(handle_accepted_callback)
        self.register_goal_callback(goal_callback)
        self.register_cancel_callback(cancel_callback)
        if execute_callback is not None:
            self.register_execute_callback(execute_callback)
        self._types = ActionTypes(action_type)
        self._runs = Inbox(node.handle, self._run_here, ReentrantCallbackGroup(), entity=self)
        self._wire = ServerEndpoints(
            node.handle,
            self._types,
            names,
            serve={"send_goal": self._goal_came, "cancel_goal": self._cancel_came, "get_result": self._result_asked},
            qos={
                "send_goal": goal_service_qos_profile,
                "cancel_goal": cancel_service_qos_profile,
                "get_result": result_service_qos_profile,
                "feedback": feedback_pub_qos_profile,
                "status": status_pub_qos_profile,
            },
            group=self.callback_group,
        )
        node.add_waitable(self)
        self._watcher = Watcher(
            on_clock_change=True, min_forward_ns=1, min_backward_ns=-1, before=None, after=self._time_jumped
        )
        self._clock_state.watch(self._watcher)

    @property
    def action_type(self) -> type[Any]:
        """The action's class."""
        return self._action_type

    # -- goals come in ---------------------------------------------------------------------------------------------

    async def _goal_came(self, request: Any, waiting: PendingRequest) -> None:
        self._wire.asked("send_goal", waiting, request)
        goal_handle = await _or_refuse(waiting, self._considered(request))
        response = self._types.send_goal.Response()
        if goal_handle is not None:
            response.accepted, response.stamp = True, goal_handle._goal_info.stamp
        self._wire.answer("send_goal", waiting, response)
        if goal_handle is not None:
            self._publish_status()
            await _called(self._handle_accepted_callback, goal_handle)

    async def _considered(self, request: Any) -> ServerGoalHandle | None:
        """Ask the goal callback; the handle of a goal that is accepted."""
        goal_id = uuid_bytes(request.goal_id)
        self._logger.debug(f"New goal request with ID: {goal_id.hex()}")
        self._expire()
        if self._goals.get(goal_id) is not None:
            self._logger.debug(f"New goal rejected, its ID is taken: {goal_id.hex()}")
            return None
        verdict = await _called(self._goal_callback, request.goal)
        if not isinstance(verdict, GoalResponse):
            self._logger.warning("Goal request callback did not return a GoalResponse type. Rejecting goal.")
        return self._accepted(request) if verdict is GoalResponse.ACCEPT else None

    def _accepted(self, request: Any) -> ServerGoalHandle | None:
        goal_id, stamp = uuid_bytes(request.goal_id), self._node.get_clock().now().to_msg()
        info = self._types.goal_info(goal_id=request.goal_id, stamp=stamp)
        with self._lock:
            try:
                goal = self._goals.accept(goal_id, ns_of(stamp))
            except UsageError as error:  # meanwhile its id was taken, or too many run
                self._logger.error(f"Failed to accept new goal with ID {goal_id.hex()}: {error}")
                return None
            goal_handle = goal.payload = ServerGoalHandle(self, goal, info, request.goal)
            goal_handle._status_entry = self._types.goal_status(goal_info=info, status=int(goal.state))
            self._goal_handles[goal_id] = goal_handle
            for gone in [key for key in self._goal_handles if self._goals.get(key) is None]:
                del self._goal_handles[gone]  # the oldest result made room
        return goal_handle

    # -- goals run -------------------------------------------------------------------------------------------------

    def notify_execute(
        self, goal_handle: ServerGoalHandle, execute_callback: Callable[[ServerGoalHandle], Any] | None
    ) -> None:
        """Have the executor run it; nothing where there is no callback at all."""
        callback = self._execute_callback if execute_callback is None else execute_callback
        if callback is None:
            return
        executor = self._node.executor
        if executor is None:  # whoever spins the node next
            self._runs.put((callback, goal_handle))
        else:
            executor.create_task(self._execute_goal, callback, goal_handle)

    def _run_here(self, job: tuple[Callable[[ServerGoalHandle], Any], ServerGoalHandle]) -> Any:
        return self._execute_goal(*job)

    async def _execute_goal(self, execute_callback: Callable[[Any], Any], goal_handle: ServerGoalHandle) -> None:
        goal_id = uuid_bytes(goal_handle.goal_id).hex()
        self._logger.debug(f"Executing goal with ID {goal_id}")
        result: Any = None
        try:
            result = await _called(execute_callback, goal_handle)
        except Exception as error:
            self._logger.error(f"Error raised in execute callback: {error}")
            traceback.print_exc()
        if goal_handle.is_active:
            self._logger.warning(f"Goal state not set, assuming aborted. Goal ID: {goal_id}")
            goal_handle.abort()
        if result is not None and not isinstance(result, self._action_type.Result):
            self._logger.error(f"The execute callback returned a {type(result).__name__}, no Result: it is left out")
            result = None
        if not goal_handle._result_future.done():
            self._set_result(goal_handle, result)

    def _now_s(self) -> float:
        state = self._clock_state
        return self._node.handle.clock.monotonic_s() if state.runs else state.now_ns() / S_TO_NS

    def _time_jumped(self, jump: Jump) -> None:
        """Simulated time goes on in jumps, which no timer of the node counts."""
        due_s = self._goals.next_expiry_s()
        if due_s is not None and (jump.of_source or due_s <= self._now_s()):
            self._look_again()

    def notify_goal_done(self) -> None:
        """A goal reached its end: its result will have to be forgotten."""
        with self._lock:
            due_s = self._goals.next_expiry_s()
            if self._timer is None and due_s is not None and self._clock_state.runs and not self._destroyed:
                with suppress(UsageError):  # the node was destroyed
                    wait_s = max(_SOON_S, due_s - self._now_s())
                    self._timer = self._node.handle.create_timer(wait_s, self._look_again)

    def _look_again(self) -> None:
        with self._lock:
            if self._timer is not None:
                self._timer.cancel()
                self._timer = None
            self._expire()
            self.notify_goal_done()

    def _expire(self) -> None:
        """Forget the results whose time is over."""
        with self._lock:
            gone = self._goals.expire(self._now_s())
            for goal in gone:
                self._goal_handles.pop(goal.goal_id, None)
                goal.payload.destroy()
        if gone:
            self._publish_status()

    # -- what goal handles ask for ---------------------------------------------------------------------------------

    def _update_state(self, goal_handle: ServerGoalHandle, event: GoalEvent) -> None:
        with self._lock:
            goal = goal_handle._goal
            if goal is None:
                return
            try:
                state = self._goals.apply(goal, event.native, self._now_s())
            except UsageError:
                was = goal.state.name
                raise RCLError(f"Failed to update goal state: a goal that is {was} takes no {event.name}") from None
            goal_handle._status_entry.status = int(state)
            self._publish_status()
            if not goal.is_active:
                self.notify_goal_done()

    def _feed_back(self, goal_handle: ServerGoalHandle, feedback: Any) -> None:
        if not isinstance(feedback, self._action_type.Feedback):
            raise TypeError(f"Expected {self._action_type.Feedback}, got {type(feedback)}")
        if goal_handle._goal is not None:
            self._wire.publish_feedback(goal_handle.goal_id, feedback)

    def _set_result(self, goal_handle: ServerGoalHandle, result: Any) -> None:
        response = self._types.get_result.Response()
        response.status = goal_handle.status
        if result is not None:
            response.result = result
        goal_handle._result_future.set_result(response)

    def _publish_status(self) -> None:
        with self._lock:
            self._wire.publish_status([goal.payload._status_entry for goal in self._goals.listed(_DONE_LISTED)])

    # -- results and cancels ---------------------------------------------------------------------------------------

    def _result_asked(self, request: Any, waiting: PendingRequest) -> None:
        self._wire.asked("get_result", waiting, request)
        self._expire()
        goal_handle = self._goal_handles.get(uuid_bytes(request.goal_id))
        if goal_handle is None:
            response = self._types.get_result.Response()
            response.status = int(GoalState.UNKNOWN)
            self._wire.answer("get_result", waiting, response)
        elif self._wire.waiting("get_result") > LIMITS.service_backlog:
            waiting.refuse(f"too many clients wait for results: {LIMITS.service_backlog}")
        else:
            goal_handle._result_future.add_done_callback(partial(self._result_came, waiting))

    def _result_came(self, waiting: PendingRequest, future: Any) -> None:
        self._wire.answer("get_result", waiting, future.result())

    async def _cancel_came(self, request: Any, waiting: PendingRequest) -> None:
        self._wire.asked("cancel_goal", waiting, request)
        response = await _or_refuse(waiting, self._canceled(request.goal_info))
        self._wire.answer("cancel_goal", waiting, response)

    async def _canceled(self, info: Any) -> Any:
        """Ask the cancel callback of each goal that is meant; the response."""
        with self._lock:
            code, meant = self._goals.to_cancel(uuid_bytes(info.goal_id), ns_of(info.stamp))
        canceling = []
        for goal in meant:
            goal_handle: ServerGoalHandle = goal.payload
            if await _called(self._cancel_callback, goal_handle) is CancelResponse.ACCEPT:
                with suppress(RCLError):  # it ended while its callback was asked
                    goal_handle._update_state(GoalEvent.CANCEL_GOAL)
                    canceling.append(goal_handle._goal_info)
        if meant and not canceling:
            code = CancelCode.REJECTED
        return self._types.cancel_goal.Response(return_code=int(code), goals_canceling=canceling)

    # -- callbacks -------------------------------------------------------------------------------------------------

    def register_handle_accepted_callback(self, handle_accepted_callback: Callable[[Any], Any] | None) -> None:
        """Call this with the handle of each goal that was accepted; None executes it at once."""
        self._handle_accepted_callback = handle_accepted_callback or default_handle_accepted_callback

    def register_goal_callback(self, goal_callback: Callable[[Any], Any] | None) -> None:
        """Ask this whether to accept a Goal message: it returns a GoalResponse. None accepts all."""
        self._goal_callback = goal_callback or default_goal_callback

    def register_cancel_callback(self, cancel_callback: Callable[[Any], Any] | None) -> None:
        """Ask this whether the goal of a handle may be cancelled: it returns a CancelResponse. None refuses all."""
        self._cancel_callback = cancel_callback or default_cancel_callback

    def register_execute_callback(self, execute_callback: Callable[[Any], Any]) -> None:
        """Run this for goals from now on; TypeError where it cannot be called."""
        if not callable(execute_callback):
            raise TypeError("Failed to register goal execution callback: not callable")
        self._execute_callback = execute_callback

    def configure_introspection(
        self, clock: Any, service_event_qos_profile: QoSProfile, introspection_state: ServiceIntrospectionState
    ) -> None:
        """Tell of each call of the three services on `<service>/_service_event`, or, with OFF, no more."""
        self._wire.configure_introspection(clock, service_event_qos_profile, introspection_state)

    # -- as a waitable ---------------------------------------------------------------------------------------------

    def get_num_entities(self) -> NumberOfEntities:
        """Three services, and a timer for what expires."""
        return NumberOfEntities(num_timers=1, num_services=3)

    def add_to_wait_set(self, wait_set: Any) -> None:
        """Nothing: its services are mailboxes of the node, which the executor knows."""

    def is_ready(self, wait_set: Any) -> bool:
        """Never, for the same reason."""
        return False

    def destroy(self) -> None:
        """Leave the graph. Clients that wait learn that nobody answers; goals go on unheard. Safe to call twice."""
        with self._lock:
            if self._destroyed:
                return
            self._destroyed = True
            self._clock_state.forget(self._watcher)
            if self._timer is not None:
                self._timer.cancel()
        for goal_handle in self._goal_handles.values():
            goal_handle.destroy()
        self._wire.close()
        self._runs.close()
        with suppress(ValueError):
            self._node.remove_waitable(self)


async def _called(callback: Callable[[Any], Any], about: Any) -> Any:
    """What a plain or `async def` callback returns."""
    result = callback(about)
    return await result if isawaitable(result) else result


async def _or_refuse(waiting: PendingRequest, answer: Any) -> Any:
    """What the coroutine returns; what it raises goes on to `spin`, and the client is told that it gets no answer."""
    try:
        return await answer
    except Exception as error:
        waiting.refuse(f"{type(error).__name__}: {error}")
        raise
    except BaseException:  # the executor was shut down under it
        waiting.drop()
        raise
