"""Parameters and lifecycle of a robot's running nodes, by the nodes' own services.

What is set here is set now, and forgotten with the node's process; with `keep` it is the twin's as well, which sees to
it again after every start, and on a robot that is offline as soon as it is back.
"""

from __future__ import annotations

import asyncio
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from gateway.domain.fleet.parameter import Rules, plain, rules_of, wired
from gateway.errors import CommandRefusedError, InvalidRequestError, RobotError
from gateway.fleet.command_manager import CommandManager, NewCommand
from gateway.fleet.manager import FleetManager
from gateway.fleet.nodes.manager import NodeManager
from gateway.fleet.nodes.verbs import Actor
from gateway.fleet.twins.feature import Twins
from gateway.fleet.twins.plan import Edit, Outcome
from metaros.errors import ParameterError
from metaros.fleet.twin import read
from metaros.idl import names
from metaros.limits import LIMITS

__all__ = ["TRANSITIONS", "Lifecycle", "NodeValues", "Parameter", "SetResult"]

AT_ONCE = 256  # names in one call: the answer stays far below what a link takes
MOST = 4096  # of one node
TRANSITIONS = ("configure", "activate", "deactivate", "cleanup", "shutdown")
CHANGING = ("SetParameters", "ChangeState")
KEPT_STATES = ("inactive", "active", "finalized")  # that a twin can name


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter:
    """One of a node's: its rules, its value now, and what the twin says of it (`wanted` is a value or absent)."""

    rules: Rules
    kind: str
    value: Any
    wanted: Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class SetResult:
    """What became of one value; `value` is what the node was given, as a twin keeps it."""

    name: str
    successful: bool
    reason: str = ""
    value: Any = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Lifecycle:
    """A node's state; without `managed` it has none. `transitions` are those that lead on from here."""

    managed: bool
    state: str = ""
    wanted: str | None = None
    transitions: tuple[tuple[int, str], ...] = ()


class NodeValues:
    """All methods on the event loop. `node` is the full ROS name of a node of the robot, see `full_name`."""

    def __init__(
        self, manager: NodeManager, twins: Twins, fleet: FleetManager, command_manager: CommandManager
    ) -> None:
        self._manager = manager
        self._twins = twins
        self._fleet = fleet
        self._command_manager = command_manager

    async def full_name(self, robot: str, node: str, ros_name: str) -> str:
        """The ROS name of a node of the table, or the one that is given, which may be any of the robot's.

        Raises:
            UnknownRobotError, UnknownNodeError: there is no such thing.
            NameError_: `ros_name` is no ROS name.
        """
        found = (await self._manager.of_robot(robot)).get(node)
        if not ros_name:
            return found.ros_name
        view = self._manager.view_of(robot)
        return names.resolve(ros_name, view.robot.namespace if view is not None else f"/{robot}")

    # -- parameters ------------------------------------------------------------------------------------------------

    async def parameters(self, robot: str, node: str) -> list[Parameter]:
        """All of them by name. RobotError: the robot or the node is not there, or has none."""
        listed = await self._call(robot, node, "ListParameters", "list_parameters", {"depth": 0, "prefixes": []})
        found = sorted(listed["result"]["names"])[:MOST]
        rules, values = await asyncio.gather(self._rules(robot, node, found), self._values(robot, node, found))
        wanted = self._wanted(robot, "parameters", node) or {}
        return [
            Parameter(
                rules=rules.get(name) or Rules(name=name, kind=values[name][0]),
                kind=values[name][0],
                value=values[name][1],
                wanted={"value": wanted[name]} if name in wanted else {},
            )
            for name in found
        ]

    async def set_parameters(
        self, robot: str, node: str, values: Mapping[str, Any], actor: Actor, *, keep: bool, dry_run: bool
    ) -> tuple[list[SetResult], Outcome | None]:
        """Set each for itself; None takes away what is dynamically typed. What the node's own rules forbid is refused
        here and never sent. With `keep` the twin gets those that the node took; all of them where it cannot be asked.

        Raises:
            RobotError: the robot or the node is not there; nothing was set.
            TwinError: the twin cannot keep them; the node has them.
        """
        try:
            results = await self._set(robot, node, values, actor, dry_run=dry_run)
        except RobotError as error:
            if not keep or (isinstance(error, CommandRefusedError) and error.agent_code != "unavailable"):
                raise
            reason = f"kept for later: {error}"[:300]
            results = [SetResult(name, True, reason, value) for name, value in values.items()]
        taken = {item.name: item.value for item in results if item.successful}
        edited = None
        if keep and taken:
            edited = await self._keep(robot, "parameters", node, taken, actor, dry_run=dry_run)
        return results, edited

    async def _set(
        self, robot: str, node: str, values: Mapping[str, Any], actor: Actor, *, dry_run: bool
    ) -> list[SetResult]:
        rules = await self._rules(robot, node, list(values))
        wire: list[dict[str, Any]] = []
        results: dict[str, SetResult] = {}
        for name, value in values.items():
            known = rules.get(name)
            try:
                fault = known.fault(value) if known is not None else ""
                kind = "not_set" if known is None or known.dynamic_typing else known.kind
                wire_value = {"type": 0} if fault else wired(value, kind)
            except ParameterError as error:
                fault = str(error)
            if fault:
                results[name] = SetResult(name, False, fault)
            else:
                wire.append({"name": name, "value": wire_value})
        said: Sequence[Mapping[str, Any]] = [{"successful": True, "reason": ""}] * len(wire)
        if wire and not dry_run:
            asked = {"node": node, "parameters": {item["name"]: values[item["name"]] for item in wire}}
            with self._command_manager.track(
                NewCommand(robot=robot, kind="set_parameters", request=asked), actor.principal
            ):
                answer = await self._call(robot, node, "SetParameters", "set_parameters", {"parameters": wire})
            said = answer["results"]
        if len(said) != len(wire):
            raise CommandRefusedError(f"{node} answered {len(said)} of {len(wire)} parameters", agent_code="peer")
        for item, result in zip(wire, said, strict=True):
            name = item["name"]
            # Whole numbers may have come as text: the node's own kind tells, not their looks.
            kept = item["value"].get("integer_value", item["value"].get("integer_array_value", values[name]))
            results[name] = SetResult(name, bool(result["successful"]), str(result["reason"]), kept)
        return [results[name] for name in values]

    async def _rules(self, robot: str, node: str, wanted: list[str]) -> dict[str, Rules]:
        """By name; without those that the node does not know."""
        found: dict[str, Rules] = {}
        for some in _slices(wanted):
            answer = await self._call(robot, node, "DescribeParameters", "describe_parameters", {"names": some})
            for name, descriptor in zip(some, answer["descriptors"], strict=False):
                if descriptor["name"] == name and descriptor["type"]:
                    found[name] = rules_of(descriptor)
        return found

    async def _values(self, robot: str, node: str, wanted: list[str]) -> dict[str, tuple[str, Any]]:
        found: dict[str, tuple[str, Any]] = dict.fromkeys(wanted, ("not_set", None))
        for some in _slices(wanted):
            answer = await self._call(robot, node, "GetParameters", "get_parameters", {"names": some})
            found.update((name, plain(value)) for name, value in zip(some, answer["values"], strict=False))
        return found

    # -- lifecycle -------------------------------------------------------------------------------------------------

    async def lifecycle(self, robot: str, node: str) -> Lifecycle:
        """Its state, and where it may go from there. RobotError where the robot is not there."""
        wanted = self._wanted(robot, "lifecycle", node)
        try:
            now = await self._state(robot, node)
            answer = await self._call(robot, node, "GetAvailableTransitions", "get_available_transitions", {})
        except CommandRefusedError as error:
            if error.agent_code == "unavailable":  # nobody offers it: no managed node, or it is not running
                return Lifecycle(managed=False, wanted=wanted)
            raise
        steps = [(item["transition"]["id"], item["transition"]["label"]) for item in answer["available_transitions"]]
        return Lifecycle(managed=True, state=now, wanted=wanted, transitions=tuple(_known(steps)))

    async def change_state(
        self, robot: str, node: str, transition: str, actor: Actor, *, keep: bool, dry_run: bool
    ) -> tuple[bool, Lifecycle, Outcome | None]:
        """Have it make a transition; whether it did, and how it is now. With `keep` the twin names the new state.

        Raises:
            InvalidRequestError: no transition of that name, or the node has no lifecycle.
            RobotError: the robot or the node is not there.
        """
        if transition not in TRANSITIONS:
            raise InvalidRequestError(f"transition is one of {', '.join(TRANSITIONS)}")
        before = await self.lifecycle(robot, node)
        if not before.managed:
            raise CommandRefusedError(f"{node} has no lifecycle, or does not run", agent_code="unavailable")
        number = next((number for number, label in before.transitions if label == transition), None)
        if number is None or dry_run:
            return number is not None, before, None
        asked = {"node": node, "transition": transition}
        with self._command_manager.track(NewCommand(robot=robot, kind="change_state", request=asked), actor.principal):
            request = {"transition": {"id": number, "label": transition}}
            answer = await self._call(robot, node, "ChangeState", "change_state", request)
        after = await self.lifecycle(robot, node)
        edited = None
        if answer["success"] and keep:
            state = after.state if after.state in KEPT_STATES else None
            edited = await self._keep(robot, "lifecycle", node, state, actor, dry_run=False)
            after = replace(after, wanted=state)
        return bool(answer["success"]), after, edited

    async def _state(self, robot: str, node: str) -> str:
        return str((await self._call(robot, node, "GetState", "get_state", {}))["current_state"]["label"])

    # -- parts -----------------------------------------------------------------------------------------------------

    async def _call(self, robot: str, node: str, kind: str, service: str, request: Mapping[str, Any]) -> Any:
        """Ask a service of the node. What only looks has few of the robot's places for commands, so that whoever may
        look at most cannot keep a stop from getting through."""
        package = "rcl_interfaces" if "Parameters" in kind else "lifecycle_msgs"
        return await self._fleet.call(
            robot,
            f"{node}/{service}",
            type_name=f"{package}/srv/{kind}",
            request=request,
            timeout_s=LIMITS.node_call_s,
            look=kind not in CHANGING,
        )

    def _wanted(self, robot: str, section: str, node: str) -> Any:
        """What the twin says of it, under its full name or the one within the robot's namespace."""
        rows = self._section(robot, section)
        return next((rows[key] for key in self._keys(robot, node) if key in rows), None)

    def _section(self, robot: str, section: str) -> dict[str, Any]:
        desired = self._twins.manager.desired_of(robot)
        return dict(read(desired.document).get(section) or {}) if desired is not None else {}

    def _keys(self, robot: str, node: str) -> Iterator[str]:
        view = self._manager.view_of(robot)
        prefix = view.robot.namespace.rstrip("/") + "/" if view is not None else f"/{robot}/"
        yield node
        if node.startswith(prefix):
            yield node.removeprefix(prefix)

    async def _keep(
        self, robot: str, section: str, node: str, value: Any, actor: Actor, *, dry_run: bool
    ) -> Outcome | None:
        """Into the robot's own document, under the name that the twin has for the node already."""
        rows = self._section(robot, section)
        key = next((key for key in self._keys(robot, node) if key in rows), node)
        edit = Edit(patch={section: {key: value}})
        return await self._twins.manager.edit(robot, edit, actor.editor, dry_run=dry_run)


def _known(steps: Sequence[tuple[int, str]]) -> Iterator[tuple[int, str]]:
    """Those that a person asks for, not a node's inner ones."""
    yield from (step for step in steps if step[1] in TRANSITIONS)


def _slices(items: list[str]) -> Iterator[list[str]]:
    for start in range(0, len(items), AT_ONCE):
        yield items[start : start + AT_ONCE]
