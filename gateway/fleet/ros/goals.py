"""Goals for robots' action servers: sent as commands, followed until they end.

The robot's agent follows a goal, link or no link. While there is none the goal is `unreachable`; it ends as "lost" when
the robot comes back without it, or does not come back for `goal_lost_s`. A robot that comes from another gateway
brings its goals along, and they can be found here from then on.
"""

from __future__ import annotations

import asyncio
import uuid
from collections import OrderedDict
from collections.abc import Awaitable, Callable
from typing import Any

from gateway.errors import TooManyError
from gateway.fleet.command_dispatcher import CommandDispatcher
from gateway.fleet.manager import FleetManager
from gateway.fleet.robots import FindRobot, require_online
from gateway.fleet.ros.errors import UnknownActionError, UnknownGoalError
from gateway.fleet.ros.goal import Goal
from gateway.fleet.ros.graph_registry import GraphRegistry
from gateway.fleet.ros.typed import catalogue_for, decode, encode
from gateway.fleet.ros.types import full_type_name
from metaros._proto import link_pb2
from metaros.clock import Clock
from metaros.idl import Catalogue, default_catalogue, names
from metaros.limits import LIMITS, Limits

__all__ = ["GoalManager"]

CANCEL = "action_msgs/srv/CancelGoal_Response"
MESSAGE_CHARS = 1024


class GoalManager:
    """`send`, `cancel`, `find`, `of` for clients; the rest for the link. All on the event loop."""

    def __init__(
        self,
        find: FindRobot,
        commands: CommandDispatcher,
        fleet: FleetManager,
        graphs: GraphRegistry,
        *,
        clock: Clock,
        limits: Limits = LIMITS,
    ) -> None:
        self._find = find
        self._commands = commands
        self._fleet = fleet
        self._graphs = graphs
        self._clock = clock
        self._limits = limits
        self._goals: dict[str, OrderedDict[bytes, Goal]] = {}

    async def send(
        self,
        robot_id: str,
        action: str,
        *,
        type_name: str = "",
        goal: Any = None,
        cdr: bytes | None = None,
        timeout_s: float = LIMITS.command_timeout_s,
        lease_id: str = "",
        sent_ns: int = 0,
        by: str = "",
        claim: Callable[[str], Awaitable[str]] | None = None,
    ) -> Goal:
        """Send a goal, `cdr` (of X_Goal) wins over `goal`; returns when the server has taken or rejected it.

        `claim` gets the goal's id when all is well and nothing has left, and answers with the id of the goal that the
        same request began: another one is looked up, and nothing is sent.

        Raises:
            UnknownActionError: no type is given, and the robot's graph has no such action.
            FieldError, UnknownTypeError, TypeHashError: the goal does not fit its type, or that is not known.
            LeaseRequiredError: the action moves the robot, and the lease is not held.
            RobotOfflineError, CommandTimeoutError, CommandRefusedError: see CommandDispatcher.
        """
        view = require_online(self._find(robot_id))
        full = names.resolve(action, view.robot.namespace)
        self._fleet.check_lease(robot_id, full, lease_id)
        name, type_hash = self._type_of(robot_id, full, type_name)
        catalogue = catalogue_for(self._graphs.of(robot_id), f"{name}_SendGoal", type_hash)
        payload = cdr if cdr is not None else await asyncio.to_thread(encode, f"{name}_Goal", goal, catalogue)
        kept = Goal(robot_id, uuid.uuid4().bytes, full, name, catalogue, by=by, started_ns=self._clock.wall_ns())
        self._keep(kept)
        send = link_pb2.SendGoal(action=full, type_name=name, goal_id=kept.goal_id, goal=payload, type_hash=type_hash)
        command = link_pb2.Command(send_goal=send, lease_id=lease_id, sent_ns=sent_ns)
        try:
            if claim is not None and (begun := await claim(kept.id)) != kept.id:
                return self._instead(kept, begun)
            result = await self._commands.run(robot_id, command, timeout_s=timeout_s)
            answer = decode(f"{name}_SendGoal_Response", result.payload, catalogue)
        except BaseException:  # should it go on nevertheless, the robot will tell of it
            self._forget(kept)
            raise
        kept.accepted = bool(answer["accepted"])
        if not kept.accepted:
            self._end(kept, "rejected", "the action's server does not take it")
        return kept

    async def cancel(self, robot_id: str, goal_id: str, *, timeout_s: float = LIMITS.command_timeout_s) -> bool:
        """Ask the server to stop a goal; whether it will. The goal's end is told by its events."""
        goal = self.find(robot_id, goal_id)
        if goal.ended:
            return False
        require_online(self._find(robot_id))
        command = link_pb2.Command(cancel_goal=link_pb2.CancelGoal(goal_id=goal.goal_id))
        result = await self._commands.run(robot_id, command, timeout_s=timeout_s)
        answer = decode(CANCEL, result.payload, default_catalogue())
        stopping = [bytes(info["goal_id"]["uuid"]) for info in answer["goals_canceling"]]
        return goal.goal_id in stopping

    def find(self, robot_id: str, goal_id: str) -> Goal:
        """A goal by its id, 32 hexadecimal digits with or without dashes; UnknownGoalError."""
        self._find(robot_id)
        try:
            key = uuid.UUID(goal_id).bytes
            return self._goals[robot_id][key]
        except (ValueError, KeyError):
            raise UnknownGoalError(f"robot {robot_id} has no goal {goal_id[:64]!r} that this gateway knows") from None

    def of(self, robot_id: str) -> list[Goal]:
        """The goals of a robot that are known, the newest first."""
        return list(reversed(self._goals.get(robot_id, OrderedDict()).values()))

    def open_events(self, robot_id: str) -> link_pb2.GoalEvents:
        """The state of the robot's open goals, as its agent would report it, for a gateway that has not received it."""
        graph, events = self._graphs.of(robot_id), link_pb2.GoalEvents()
        for goal in self.of(robot_id):
            info = graph.actions.get(goal.action)
            if goal.accepted and not goal.ended and goal.reachable:
                events.events.add(
                    goal_id=goal.goal_id,
                    action=goal.action,
                    type_name=goal.type_name,
                    type_hash=info.type_hash if info is not None and info.type_name == goal.type_name else "",
                    status=goal.status_number,
                    skipped=goal.skipped,
                )
        return events

    # -- the link ---------------------------------------------------------------------------------------------------

    def on_events(self, robot_id: str, report: link_pb2.GoalEvents) -> None:
        """A robot tells of its goals."""
        for event in report.events:
            _shorten(event, self._limits)
            goal = self._goals.get(robot_id, OrderedDict()).get(event.goal_id) or self._adopt(robot_id, event)
            if goal is not None:
                goal.take(event)
                goal.changed_s = self._clock.monotonic_s()
        if report.all_told:
            known = set(report.goal_ids)
            for goal in self.of(robot_id):
                if not goal.ended and goal.goal_id not in known:
                    self._end(goal, "lost", "the robot's agent was started anew and does not know the goal any more")

    def on_online(self, robot_id: str, *, online: bool) -> None:
        """The link came or went."""
        if not online:
            for goal in self.of(robot_id):
                goal.unreachable(self._clock.monotonic_s())

    def tick(self) -> None:
        """End what was lost for too long, forget what ended long ago; call about once a second."""
        now_s = self._clock.monotonic_s()
        for robot_id, goals in list(self._goals.items()):
            for goal in list(goals.values()):
                away_s = now_s - goal.changed_s
                if goal.ended and away_s > self._limits.goal_kept_s:
                    del goals[goal.goal_id]
                elif not goal.ended and not goal.reachable and away_s > self._limits.goal_lost_s:
                    text = f"the robot had no link to this gateway for {self._limits.goal_lost_s:g} s"
                    self._end(goal, "lost", text)
            if not goals:
                del self._goals[robot_id]

    def _type_of(self, robot_id: str, action: str, type_name: str) -> tuple[str, str]:
        """The action's type, and the hash of its X_SendGoal as the robot has it ("" = nobody serves it yet)."""
        info = self._graphs.of(robot_id).actions.get(action)
        if not type_name and info is None:
            raise UnknownActionError(f"type is missing, and robot {robot_id} has no action {action}")
        name = full_type_name(type_name or (info.type_name if info else ""), "action")
        return name, info.type_hash if info is not None and info.type_name == name else ""

    def _keep(self, goal: Goal) -> None:
        """Remember it; TooManyError when so many are open already."""
        goals = self._goals.setdefault(goal.robot, OrderedDict())
        if sum(not one.ended for one in goals.values()) >= self._limits.goals_open:
            raise TooManyError(f"robot {goal.robot} has {self._limits.goals_open} goals under way already")
        if len(goals) >= self._limits.goals_kept:
            del goals[next(key for key, one in goals.items() if one.ended)]
        goals[goal.goal_id] = goal

    def _forget(self, goal: Goal) -> None:
        self._goals.get(goal.robot, OrderedDict()).pop(goal.goal_id, None)

    def _instead(self, goal: Goal, begun: str) -> Goal:
        self._forget(goal)
        return self.find(goal.robot, begun)

    def _adopt(self, robot_id: str, report: link_pb2.GoalEvent) -> Goal | None:
        """A goal that another gateway sent, or this one before it was started anew."""
        if len(report.goal_id) != 16 or len(report.action) + len(report.type_name) > LIMITS.ros_name_chars:
            return None
        catalogue: Catalogue | None = self._graphs.of(robot_id).catalogue_of(
            f"{report.type_name}_SendGoal", report.type_hash
        )
        goal = Goal(
            robot_id, report.goal_id, report.action, report.type_name, catalogue, started_ns=self._clock.wall_ns()
        )
        try:
            self._keep(goal)
        except TooManyError:
            return None
        return goal

    def _end(self, goal: Goal, status: Any, message: str) -> None:
        goal.finish(status, link_pb2.GoalEvent(message=message, stamp_ns=self._clock.wall_ns()))
        goal.changed_s = self._clock.monotonic_s()


def _shorten(report: link_pb2.GoalEvent, limits: Limits) -> None:
    """Leave out what an agent would not have sent: so many goals are kept, with what was told last of each."""
    report.message = report.message[:MESSAGE_CHARS]
    if len(report.feedback) > limits.goal_feedback_bytes:
        report.feedback, report.skipped = b"", min(report.skipped + 1, 1 << 62)
    if len(report.result) > limits.result_bytes:
        report.message = f"its result of {len(report.result)} bytes is left out: at most {limits.result_bytes} are kept"
        report.result = b""
