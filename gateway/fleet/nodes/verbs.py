"""Verbs for robots' nodes: start and stop by the twin, so that they last, and at once where the robot is there.

`start` and `stop` of a node that the twin names change its `run`: a robot that is offline does it when it is back. The
other verbs are of this moment, and fail where the robot is not there.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from gateway.domain.fleet.node import VERBS, NodeState
from gateway.domain.fleet.selector import Selector
from gateway.domain.principal import Principal
from gateway.errors import CommandRefusedError, InvalidRequestError, RobotError, RobotOfflineError, TooManyError
from gateway.fleet.command_dispatcher import CommandDispatcher
from gateway.fleet.command_manager import CommandManager, NewCommand
from gateway.fleet.nodes.manager import NodeManager
from gateway.fleet.twins.feature import Twins
from gateway.fleet.twins.manager import Editor
from gateway.fleet.twins.plan import Edit, Outcome
from metaros._proto import link_pb2
from metaros.clock import Clock
from metaros.errors import MetarosError
from metaros.limits import LIMITS

__all__ = ["Actor", "NodeAction", "NodeVerbs", "Result"]

LASTING = ("start", "stop")
NOT_YET = "invalid_config"  # what a supervisor says to `start` before it has the row that lets the node run
AGAIN_S = 0.25
MAX_SIGNAL = 64


@dataclass(frozen=True, slots=True, kw_only=True)
class NodeAction:
    """A verb on a node of that name."""

    node: str
    verb: str
    signal: int = 0

    def __post_init__(self) -> None:
        """InvalidRequestError for what no robot would do."""
        if self.verb not in VERBS:
            raise InvalidRequestError(f"verb is one of {', '.join(VERBS)}")
        if (self.verb == "signal") != (1 <= self.signal <= MAX_SIGNAL):
            raise InvalidRequestError(f"signal, and it alone, has a signal's number: 1 to {MAX_SIGNAL}")

    @property
    def wire(self) -> link_pb2.Command:
        """As the robot gets it."""
        verb = link_pb2.NodeVerb(node=self.node, verb=self.verb, signal=self.signal)
        return link_pb2.Command(node_verb=verb)

    @property
    def lasts(self) -> bool:
        """Whether the twin can say it, too: said twice it is the same."""
        return self.verb in LASTING

    def order(self, robot: str) -> NewCommand:
        """As the history of commands has it."""
        asked: dict[str, Any] = {"node": self.node, "verb": self.verb}
        asked |= {"signal": self.signal} if self.verb == "signal" else {}
        return NewCommand(robot=robot, kind="node_verb", request=asked, timeout_s=LIMITS.node_verb_s)

    @property
    def edit(self) -> Edit:
        """What `start` and `stop` change of the twin."""
        return Edit(patch={"nodes": {self.node: {"run": self.verb == "start"}}})


@dataclass(frozen=True, slots=True, kw_only=True)
class Actor:
    """Who does it: for the twin's history, and for that of commands."""

    editor: Editor
    principal: Principal


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """What became of a deed at one robot.

    `outcome`: done, pending (the twin has it; the robot does it when it gets it), or failed with `error`. `told`: the
    robot itself has done it. With a dry run: what would become of it.
    """

    robot: str
    action: NodeAction
    dry_run: bool
    outcome: str
    told: bool = False
    edited: Outcome | None = None
    error: MetarosError | None = None


class NodeVerbs:
    """All methods on the event loop."""

    def __init__(
        self,
        manager: NodeManager,
        twins: Twins,
        commands: CommandDispatcher,
        command_manager: CommandManager,
        *,
        clock: Clock,
    ) -> None:
        self._manager = manager
        self._twins = twins
        self._commands = commands
        self._command_manager = command_manager
        self._clock = clock

    async def act(self, robot: str, action: NodeAction, actor: Actor, *, dry_run: bool) -> Result:
        """Do it to one robot's node.

        Raises:
            UnknownRobotError, UnknownNodeError: there is no such thing.
            TwinError, ForbiddenError: see TwinManager.edit.
        """
        node = (await self._manager.of_robot(robot)).get(action.node)
        edited = None
        if _edits(node, action):
            edited = await self._twins.manager.edit(robot, action.edit, actor.editor, dry_run=dry_run)
        return await self._at_robot(node, action, actor, edited, dry_run=dry_run)

    async def act_many(
        self, selector: Selector, action: NodeAction, actor: Actor, *, sees: Callable[[str], bool], dry_run: bool
    ) -> list[Result]:
        """Do it at every robot named that has such a node. The twins change all together or not at all; what robots
        make of it is told one by one."""
        nodes = [item.get(action.node) for item in await self._manager.with_node(selector, action.node, sees)]
        edited: dict[str, Outcome] = {}
        editing = {node.robot for node in nodes if _edits(node, action)}
        if editing:
            outcomes = await self._twins.manager.edit_many(
                selector, action.edit, actor.editor, sees=lambda robot: robot in editing, dry_run=dry_run
            )
            edited = {item.after.robot: item for item in outcomes}
        return await self._at_robots(nodes, action, actor, edited, dry_run=dry_run)

    async def _at_robots(
        self, nodes: Sequence[NodeState], action: NodeAction, actor: Actor, edited: dict[str, Outcome], *, dry_run: bool
    ) -> list[Result]:
        turns, until_s = asyncio.Semaphore(LIMITS.group_at_once), self._clock.monotonic_s() + LIMITS.group_s

        async def one(node: NodeState) -> Result:
            async with turns:
                late = self._clock.monotonic_s() >= until_s
                return await self._at_robot(
                    node, action, actor, edited.get(node.robot), dry_run=dry_run, late=late and node.online
                )

        return list(await asyncio.gather(*(one(node) for node in nodes)))

    async def _at_robot(
        self,
        node: NodeState,
        action: NodeAction,
        actor: Actor,
        edited: Outcome | None,
        *,
        dry_run: bool,
        late: bool = False,
    ) -> Result:
        lasting = action.lasts and node.desired is not None
        result = Result(robot=node.robot, action=action, dry_run=dry_run, outcome="done", edited=edited)
        error: MetarosError | None = None
        if not node.online:
            error = RobotOfflineError(f"robot {node.robot} has no link now")
        elif late:
            error = TooManyError(f"robot {node.robot}'s turn did not come within {LIMITS.group_s:g} s")
        elif not dry_run:
            try:
                await self._send(node.robot, action, actor, fresh=edited is not None)
            except MetarosError as caught:
                error = caught
        if error is None:
            return replace(result, told=not dry_run)
        comes = lasting and (edited is not None or not isinstance(error, CommandRefusedError))
        return replace(result, outcome="pending" if comes else "failed", error=error)

    async def _send(self, robot: str, action: NodeAction, actor: Actor, *, fresh: bool) -> None:
        """Have the robot do it now, and keep that among its commands. `fresh`: the twin it needs is on its way."""
        until_s = self._clock.monotonic_s() + LIMITS.node_fresh_s
        with self._command_manager.track(action.order(robot), actor.principal):
            while True:
                try:
                    await self._commands.run(robot, action.wire, timeout_s=LIMITS.node_verb_s)
                    return
                except RobotError as error:
                    code = error.agent_code if isinstance(error, CommandRefusedError) else ""
                    if not (fresh and action.verb == "start" and code == NOT_YET):
                        raise
                    if self._clock.monotonic_s() >= until_s:
                        raise
                await asyncio.sleep(AGAIN_S)


def _edits(node: NodeState, action: NodeAction) -> bool:
    """Whether the twin says otherwise until now."""
    return action.lasts and node.desired is not None and node.desired.run != (action.verb == "start")
