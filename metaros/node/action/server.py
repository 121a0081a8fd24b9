"""Action servers: goals come in, run on the executor or on worker threads, and end with a result that is kept."""

from __future__ import annotations

import atexit
import inspect
import logging
import threading
from collections.abc import Awaitable, Callable, Coroutine
from contextlib import suppress
from typing import Any, Final

from metaros.cdr import codec
from metaros.errors import ClosedError, FieldError, UsageError
from metaros.executor import Mailbox, Timer
from metaros.limits import LIMITS
from metaros.node.action.goal import TRANSITIONS, CancelCode, Goal, GoalEvent, GoalState, GoalTable
from metaros.node.action.server_goal import ServerGoal
from metaros.node.action.types import ENDPOINTS, ActionTypes, id_of, ns_of
from metaros.node.action.workers import Workers
from metaros.node.core import NodeCore
from metaros.node.info import takes
from metaros.node.publisher import Publisher
from metaros.node.service import PendingRequest, Responder
from metaros.wire import qos_default, qos_services, qos_transient_local

__all__ = ["RESULT_TIMEOUT_S", "ActionServer"]

_log = logging.getLogger("metaros.node")
RESULT_TIMEOUT_S: Final = 900.0  # rclpy's figure
_DONE_LISTED: Final = 32  # finished goals that the status topic still tells
_SOON_S: Final = 0.001
_EXIT_S: Final = 0.2  # so long the interpreter's exit waits for `execute` callbacks to notice


class ActionServer:
    """Runs `execute(goal)` for every goal that `goal(request)` accepts; `cancel(goal)` may refuse a cancel.

    An `async def` execute runs on the executor, a plain one on a thread of its own, LIMITS.action_workers at a time.
    `handle_accepted(goal)`, where given, decides when to call `goal.execute()`. Results are kept `result_timeout_s`.
    """

    def __init__(
        self,
        node: NodeCore,
        action: type[Any],
        name: str,
        execute: Callable[[ServerGoal], Any],
        *,
        goal: Callable[[Any], Any] | None = None,
        cancel: Callable[[ServerGoal], Any] | None = None,
        handle_accepted: Callable[[ServerGoal], Any] | None = None,
        result_timeout_s: float = RESULT_TIMEOUT_S,
    ) -> None:
        for callback in filter(None, (execute, goal, cancel, handle_accepted)):
            takes(callback, 1)
        self.node = node
        self.name = node.resolve(name)
        self.action = action
        self.closed = False
        self._types = ActionTypes(action)
        self._execute, self._on_goal, self._on_cancel, self._on_accepted = execute, goal, cancel, handle_accepted
        self._is_async = inspect.iscoroutinefunction(execute)
        self._asks_async = any(inspect.iscoroutinefunction(callback) for callback in (goal, cancel))
        if self._is_async or self._asks_async:
            node.ingress.async_work = True
        self._lock = threading.RLock()
        self._goals = GoalTable(keep_s=result_timeout_s, limit=LIMITS.action_goals)
        self._workers = Workers(LIMITS.action_workers, name=f"metaros{self.name}")
        self._timer: Timer | None = None
        self._encode_result = codec(self._types.get_result.Response).encode
        self._open()

    def _open(self) -> None:
        """The five endpoints, in ROS 2's order."""
        types, serving = self._types, {}
        for part, serve in (
            ("send_goal", self._goal_came),
            ("cancel_goal", self._cancel_came),
            ("get_result", self._serve_result),
        ):
            service = getattr(types, part)
            serving[part] = Responder(
                self.node, service, self.name + ENDPOINTS[part], serve, qos=qos_services, **types.coders(service)
            )
        feedback, status = self.name + ENDPOINTS["feedback"], self.name + ENDPOINTS["status"]
        self._feedback = Publisher(self.node, types.feedback, feedback, codec(types.feedback), qos_default)
        self._status = Publisher(self.node, types.status, status, codec(types.status), qos_transient_local)
        self._status.on_close(self._let_go)
        atexit.register(self._leave)  # a thread that ends with the interpreter must not be inside a Zenoh call
        self._results = serving["get_result"]
        self._endpoints = (*serving.values(), self._feedback, self._status)

    @property
    def active(self) -> list[ServerGoal]:
        """The goals that have not reached their end, oldest first."""
        with self._lock:
            return [goal.payload for goal in self._goals.active]

    def close(self) -> None:
        """Leave the graph; running goals are told to stop, clients that wait get an `unavailable` error."""
        for endpoint in reversed(self._endpoints):
            endpoint.close()

    def _leave(self) -> None:
        self._let_go()
        self._workers.settle(_EXIT_S)

    def _let_go(self) -> None:
        atexit.unregister(self._leave)
        with self._lock:
            self.closed = True
            active = self.active
            waiters = [waiting for goal in active for waiting in goal.waiters]
        for waiting in waiters:  # before `execute` learns of it: that its goal stopped is not the client's doing
            waiting.drop()
        self._workers.clear()
        for goal in active:
            goal.stop()
        if self._timer is not None:
            self._timer.cancel()

    # -- goals come in ---------------------------------------------------------------------------------------------

    def _goal_came(self, request: Any, waiting: PendingRequest) -> Awaitable[None] | None:
        return self._run_or_return(self._serve_goal(request, waiting))

    async def _serve_goal(self, request: Any, waiting: PendingRequest) -> None:
        goal_id = id_of(request.goal_id)
        with self._lock:
            wanted = not self.closed and self._goals.get(goal_id) is None and self._goals.has_room()
        wanted = wanted and await self._agrees(self._on_goal, request.goal)
        handle: ServerGoal | None = None
        stamp_ns = self.node.clock.wall_ns()
        with self._lock:
            if wanted and not self.closed and self._goals.get(goal_id) is None and self._goals.has_room():
                goal = self._goals.accept(goal_id, stamp_ns)
                entry = self._types.goal_status(goal_info=self._types.info(goal_id, stamp_ns), status=int(goal.state))
                handle = goal.payload = ServerGoal(self, goal, request.goal, entry)
        if self.closed and handle is None:
            waiting.drop()
            return
        stamp = self._types.stamp(stamp_ns if handle is not None else 0)
        waiting.answer(self._types.send_goal.Response(accepted=handle is not None, stamp=stamp))
        if handle is None:
            return
        with self._lock:
            self._publish_status()
        try:
            if self._on_accepted is None:
                handle.execute()
            else:
                self._on_accepted(handle)
        except Exception as error:
            self._failed(handle, error)

    async def _agrees(self, callback: Callable[[Any], Any] | None, about: Any) -> bool:
        """What the user's callback says; one that fails says no."""
        if callback is None:
            return True
        try:
            verdict = callback(about)
            return bool(await verdict if inspect.isawaitable(verdict) else verdict)
        except Exception:
            _log.exception("a callback of action %s failed; that counts as a no", self.name)
            return False

    def _run_or_return(self, coroutine: Coroutine[Any, Any, None]) -> Awaitable[None] | None:
        """The executor awaits it where callbacks are `async def`; plain ones need no event loop."""
        if self._asks_async:
            return coroutine
        try:
            coroutine.send(None)
        except StopIteration:
            return None
        coroutine.close()
        raise UsageError(f"a plain callback of action {self.name} returned an awaitable; make it an async def")

    # -- goals run -------------------------------------------------------------------------------------------------

    def start(self, handle: ServerGoal) -> None:
        """Run `execute` for it: what `goal.execute()` does."""
        with self._lock:
            if handle.started or not handle.is_active:
                raise UsageError(f"{handle!r} was started before, or has ended")
            handle.started = True
        if self._is_async:
            box = Mailbox(self._run_async, owner=self.node, depth=1, limit_bytes=1, size_of=lambda _: 0)
            box.pending.append(handle)
            self.node.ingress.offer(box)
        else:
            self._workers.submit(_Job(self, handle))

    def run_plain(self, handle: ServerGoal) -> None:
        """`execute` on a worker's thread."""
        if not self._begin(handle):
            return
        try:
            returned = self._execute(handle)
        except Exception as error:
            self._failed(handle, error)
        else:
            self._finish(handle, returned)

    async def _run_async(self, handle: ServerGoal) -> None:
        if not self._begin(handle):
            return
        try:
            returned = await self._execute(handle)
        except Exception as error:
            self._failed(handle, error)
        except BaseException:  # the executor was shut down under it
            self._settle(handle, GoalEvent.ABORT, None)
            raise
        else:
            self._finish(handle, returned)

    def _begin(self, handle: ServerGoal) -> bool:
        with self._lock:
            if not handle.is_active or self.closed:
                return False
            handle.running = True
            if handle.goal.may(GoalEvent.EXECUTE):  # not so when it is being cancelled already
                self._apply(handle, GoalEvent.EXECUTE)
            return True

    def _finish(self, handle: ServerGoal, returned: Any) -> None:
        """`execute` returned: a result without a word means success, nothing at all means it gave up."""
        try:
            if handle.is_active and returned is None and not self.closed:
                _log.error("execute of %r returned no result and set no state: aborted", handle)
            self._settle(handle, GoalEvent.ABORT if returned is None else GoalEvent.SUCCEED, returned)
        except Exception as error:
            self._failed(handle, error)

    def _failed(self, handle: ServerGoal, error: Exception) -> None:
        if not self.closed:
            _log.error("a callback of %r failed", handle, exc_info=error)
        self._settle(handle, GoalEvent.ABORT, None)

    def _settle(self, handle: ServerGoal, event: GoalEvent, result: Any) -> None:
        """The callback is over: end the goal if it did not, and give the result if it has none."""
        with self._lock:
            handle.running = False
            if handle.is_active:
                self.end(handle, event, result)
            elif handle.response is None:
                handle.response = self._response(handle.status, result)
        self._deliver(handle)

    def end(self, handle: ServerGoal, event: GoalEvent, result: Any) -> None:
        """Bring a goal to its end: what `succeed`, `abort` and `canceled` do."""
        with self._lock:
            goal = handle.goal
            skips = event is GoalEvent.ABORT and goal.may(GoalEvent.EXECUTE)  # aborted before it began
            after = TRANSITIONS.get((GoalState.EXECUTING if skips else goal.state, event))
            if after is not None and (result is not None or not handle.running):
                handle.response = self._response(after, result)
            if skips:
                self._goals.apply(goal, GoalEvent.EXECUTE, self.node.clock.monotonic_s())
            self._apply(handle, event)
            handle.stop()
            self._arm()
        self._deliver(handle)

    def _apply(self, handle: ServerGoal, event: GoalEvent) -> None:
        self._goals.apply(handle.goal, event, self.node.clock.monotonic_s())
        handle.entry.status = int(handle.goal.state)
        self._publish_status()

    # -- what goes out ---------------------------------------------------------------------------------------------

    def feed_back(self, handle: ServerGoal, feedback: Any) -> None:
        """Publish feedback: what `publish_feedback` does."""
        if not isinstance(feedback, self.action.Feedback):
            raise FieldError(f"the feedback of {self.name} is a Feedback, not {type(feedback).__name__}")
        if self.closed:
            raise ClosedError(f"the action server {self.name} was closed")
        if handle.is_active:
            goal_id = self._types.goal_id(handle.goal_id)
            self._feedback.publish(self._types.feedback(goal_id=goal_id, feedback=feedback))

    def _publish_status(self) -> None:
        types = self._types
        if self.closed:
            return
        entries = [goal.payload.entry for goal in self._goals.listed(_DONE_LISTED)]
        with suppress(UsageError):  # closed: nobody listens any more
            self._status.publish(types.status(status_list=entries))

    def _response(self, status: GoalState, result: Any) -> bytes:
        if result is None:
            result = self.action.Result()
        if not isinstance(result, self.action.Result):
            raise FieldError(f"the result of {self.name} is a Result, not {type(result).__name__}")
        return self._encode_result(self._types.get_result.Response(status=int(status), result=result))

    def _serve_result(self, request: Any, waiting: PendingRequest) -> None:
        with self._lock:
            if self.closed:
                waiting.drop()
                return
            goal = self._goals.get(id_of(request.goal_id))
            handle: ServerGoal | None = None if goal is None else goal.payload
            if handle is not None and handle.response is None:
                if self._results.waiting <= LIMITS.service_backlog:
                    handle.waiters.append(waiting)
                    return
                waiting.refuse(f"too many clients wait for results: {LIMITS.service_backlog}")
                return
        unknown = self._response(GoalState.UNKNOWN, None)
        waiting.answer(unknown if handle is None or handle.response is None else handle.response)

    def _deliver(self, handle: ServerGoal) -> None:
        """Answer who waits for the result, once it is there."""
        with self._lock:
            if handle.response is None:
                return
            waiters, handle.waiters = handle.waiters, []
        for waiting in waiters:
            waiting.answer(handle.response)

    # -- cancelling ------------------------------------------------------------------------------------------------

    def _cancel_came(self, request: Any, waiting: PendingRequest) -> Awaitable[None] | None:
        return self._run_or_return(self._serve_cancel(request, waiting))

    async def _serve_cancel(self, request: Any, waiting: PendingRequest) -> None:
        info = request.goal_info
        with self._lock:
            code, meant = self._goals.to_cancel(id_of(info.goal_id), ns_of(info.stamp))
        cancelling = [
            goal for goal in meant if await self._agrees(self._on_cancel, goal.payload) and self._cancel(goal)
        ]
        if meant and not cancelling:
            code = CancelCode.REJECTED
        infos = [self._types.info(goal.goal_id, goal.stamp_ns) for goal in cancelling]
        waiting.answer(self._types.cancel_goal.Response(return_code=int(code), goals_canceling=infos))
        for goal in cancelling:
            if self._workers.withdraw(_Job(self, goal.payload)):  # it waits for a thread: it need never run
                with suppress(UsageError):
                    goal.payload.canceled()

    def _cancel(self, goal: Goal) -> bool:
        with self._lock:
            if not goal.may(GoalEvent.CANCEL):  # it ended while its callback was asked
                return False
            self._apply(goal.payload, GoalEvent.CANCEL)
        goal.payload.stop()
        return True

    # -- forgetting ------------------------------------------------------------------------------------------------

    def _arm(self) -> None:
        """Look again when the first result expires. Called under the lock."""
        if self._timer is None and not self.closed and (due_s := self._goals.next_expiry_s()) is not None:
            wait_s = max(_SOON_S, due_s - self.node.clock.monotonic_s())
            with suppress(UsageError):  # the node was closed
                self._timer = self.node.create_timer(wait_s, self._expire)

    def _expire(self) -> None:
        with self._lock:
            if self._timer is not None:
                self._timer.cancel()
                self._timer = None
            gone = self._goals.expire(self.node.clock.monotonic_s())
            if gone:
                self._publish_status()
            self._arm()
        for goal in gone:
            for waiting in goal.payload.waiters:
                waiting.drop()


class _Job:
    """One execution on a worker's thread; equal to any other job of its goal, so that it can be withdrawn."""

    __slots__ = ("_handle", "_server")

    def __init__(self, server: ActionServer, handle: ServerGoal) -> None:
        self._server, self._handle = server, handle

    def __call__(self) -> None:
        self._server.run_plain(self._handle)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Job) and other._handle is self._handle

    __hash__ = None  # type: ignore[assignment]
