"""Remote action goals: sent to the robot's action servers, tracked to their results, reported while there is a link."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable, Coroutine, Mapping
from typing import TYPE_CHECKING, Any, Final

from edge_agent.errors import ScopeError, UnsupportedError
from edge_agent.forwarding.scope import Scope
from edge_agent.link.handler import SendFrame
from edge_agent.ros.goal_registry import GoalRegistry, TrackedGoal
from edge_agent.ros.raw_action import RawAction, find_endpoints, goal_id_of, statuses
from metaros._proto import link_pb2
from metaros.clock import Clock
from metaros.errors import DecodeError, MetarosError, UnavailableError
from metaros.limits import LIMITS, Limits
from metaros.node import Node
from metaros.wire import EndpointInfo

if TYPE_CHECKING:
    from edge_agent.commands.dispatcher import Action

__all__ = ["GoalRunner"]

IDLE_S: Final = 5.0  # an action's endpoints stay so long after its last goal


class GoalRunner:
    """`actions` are the commands that it carries out. All on the event loop, but for the endpoints' callbacks."""

    def __init__(self, node: Node, scope: Scope, clock: Clock, *, limits: Limits = LIMITS) -> None:
        self._node = node
        self._scope = scope
        self._limits = limits
        self._goals = GoalRegistry(clock, limits=limits)
        self._loop = asyncio.get_running_loop()
        self._wake = asyncio.Event()
        self._send_frame: SendFrame | None = None
        self._actions: dict[str, RawAction] = {}
        self._tasks: set[asyncio.Task[None]] = set()
        self._lock = threading.Lock()
        self._received: dict[bytes, tuple[int, bytes]] = {}  # of each goal how many came, and the newest

    @property
    def actions(self) -> Mapping[str, Action]:
        """By their names in `Command.action`."""
        return {"send_goal": self._send, "cancel_goal": self._cancel}

    def link(self, send: SendFrame | None) -> None:
        """A new link: the status of every goal is sent. Or none: goals go on, and their results are kept."""
        self._send_frame = send
        if send is not None:
            known = self._goals.all()
            for goal in known:
                self._say(goal.event())
            ids = [goal.goal_id for goal in known]
            send(link_pb2.AgentFrame(goals=link_pb2.GoalEvents(all_told=True, goal_ids=ids)))

    async def run(self) -> None:
        """Send feedback at its rate, until cancelled."""
        while True:
            await self._wake.wait()
            self._wake.clear()
            while self._goals.waits:
                for event in self._goals.due():
                    self._say(event)
                await asyncio.sleep(1 / self._limits.goal_feedback_hz)

    async def close(self) -> None:
        """Follow nothing any more; the servers go on."""
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        for action in self._actions.values():
            action.close()
        self._actions.clear()

    async def _send(self, command: link_pb2.Command, remaining_s: float) -> bytes:
        """See SendGoal; what the server answers."""
        want = command.send_goal
        if not self._scope.includes(want.action):
            raise ScopeError(f"{want.action} is outside the agent's namespace {self._scope.namespace}")
        if len(want.goal_id) != 16 or self._goals.find(want.goal_id) is not None:
            raise UnsupportedError("a goal has an id of its own, of 16 bytes")
        endpoints = await find_endpoints(self._node, want.action, want.type_name, want.type_hash, remaining_s)
        action = self._use(want.action, endpoints)
        goal = self._goals.begin(want.goal_id, want.action, action.type_name, action.type_hash)
        accepted = False
        try:
            answer = await action.send(want.goal_id, want.goal, remaining_s)
            accepted = len(answer) > 4 and answer[4] != 0
        finally:
            if not accepted:
                self._goals.drop(goal)
                self._let_go(action)
        if accepted:
            self._spawn(self._follow(goal, action))
        return answer

    async def _cancel(self, command: link_pb2.Command, remaining_s: float) -> bytes:
        """See CancelGoal; what the server answers."""
        goal = self._goals.find(command.cancel_goal.goal_id)
        action = self._actions.get(goal.action) if goal is not None else None
        if goal is None or action is None:
            raise UnsupportedError("this agent does not follow that goal, or not any more")
        return await action.cancel(goal.goal_id, remaining_s)

    async def _follow(self, goal: TrackedGoal, action: RawAction) -> None:
        """Until its result is here, or its server gone."""
        self._say(goal.event())
        try:
            response = await action.result(goal.goal_id)
        except MetarosError as error:
            self._goals.end(goal, status=0, code=error.code, message=f"{action.name}: {error}")
        else:
            self._take_feedback()  # which was received before it
            self._ended(goal, response)
        if goal.feedback:
            self._say(self._goals.take_feedback(goal))
        self._say(goal.event())
        self._let_go(action)

    def _ended(self, goal: TrackedGoal, response: bytes) -> None:
        status = response[4] if len(response) > 4 else 0
        if status not in (4, 5, 6):
            self._goals.end(goal, status=0, code="unavailable", message="the server does not know the goal any more")
        elif len(response) > self._limits.result_bytes:
            text = f"its result of {len(response)} bytes stays on the robot: at most {self._limits.result_bytes} go"
            self._goals.end(goal, status=status, code="too_large", message=text)
        else:
            self._goals.end(goal, status=status, result=response)

    # -- the endpoints of actions -----------------------------------------------------------------------------------

    def _use(self, name: str, endpoints: Mapping[str, EndpointInfo]) -> RawAction:
        """The endpoints for an action of that type, made when they are first needed."""
        action = self._actions.get(name)
        if action is not None and action.type_hash != endpoints["send_goal"].type_hash:
            if action.users:
                raise UnavailableError(f"goals of another version of {name} are under way")
            self._actions.pop(name).close()
            action = None
        if action is None:
            action = self._actions[name] = RawAction(self._node, name, endpoints, self._fed_back, self._status_came)
        action.users += 1
        return action

    def _let_go(self, action: RawAction) -> None:
        """One user less; the last one closes it, after a while."""
        action.users -= 1
        if not action.users:
            self._loop.call_later(IDLE_S, self._close_idle, action)

    def _close_idle(self, action: RawAction) -> None:
        if not action.users and self._actions.get(action.name) is action:
            self._actions.pop(action.name).close()

    def _fed_back(self, data: bytes) -> None:
        """On Zenoh's thread: the newest of each goal waits for the loop, which is called once."""
        goal_id = goal_id_of(data)
        if self._goals.find(goal_id) is None:  # somebody else's goal
            return
        with self._lock:
            idle = not self._received
            count, _ = self._received.get(goal_id, (0, b""))
            self._received[goal_id] = (count + 1, data)
        if idle:
            self._call(self._take_feedback)

    def _status_came(self, data: bytes) -> None:
        """On an endpoint's thread; a goal's state changes a few times in its life."""
        self._call(lambda: self._on_status(data))

    def _call(self, what: Callable[[], None]) -> None:
        try:
            self._loop.call_soon_threadsafe(what)
        except RuntimeError:  # the loop is closed: the program ends
            return

    def _take_feedback(self) -> None:
        with self._lock:
            received, self._received = self._received, {}
        for goal_id, (count, data) in received.items():
            self._goals.fed_back(goal_id, data, skipped=count - 1)
        self._wake.set()

    def _on_status(self, data: bytes) -> None:
        try:
            by_goal = statuses(data)
        except DecodeError:
            return
        for goal_id, number in by_goal.items():
            goal = self._goals.status(goal_id, number)
            if goal is not None:
                self._say(goal.event())

    def _say(self, event: link_pb2.GoalEvent) -> None:
        if self._send_frame is not None:
            self._send_frame(link_pb2.AgentFrame(goals=link_pb2.GoalEvents(events=[event])))

    def _spawn(self, work: Coroutine[Any, Any, None]) -> None:
        task = self._loop.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
