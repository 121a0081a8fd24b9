"""The nodes of robots for clients: list them, report their state, and change their rows in the twin."""

from __future__ import annotations

import asyncio
import difflib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import orjson

from gateway.domain.errors import TwinChangedError, UnknownNodeError
from gateway.domain.fleet.node import NodeState, TwinStanding, node_state
from gateway.domain.fleet.selector import Selector
from gateway.domain.fleet.twin import effective, made_of
from gateway.errors import UnknownRobotError
from gateway.fleet.robots import FindRobot, RobotView
from gateway.fleet.twins.cache import reported_values
from gateway.fleet.twins.feature import Twins
from gateway.fleet.twins.manager import Editor, TwinState
from gateway.fleet.twins.plan import Edit, Outcome
from metaros.fleet.twin import Twin, TwinError, parse, parse_part, read

__all__ = ["Holder", "NodeManager", "RobotNodes", "nobody"]

VALUES_BYTES = 64 * 1024  # of one robot's report in a list of many; longer ones are shown robot by robot
ROBOTS_AT_ONCE = 16  # that are laid together in one go: a large fleet never holds the loop up
TRIES = 5  # of an edit of ours while others edit the same twin
Holder = Callable[[str, str], str | None]  # of a robot's node: the robot that has its lease, None where nobody has
Expected = tuple[int, int | None] | None


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotNodes:
    """One robot's nodes by name, and what the robot stands in. `own` are those that its own document names."""

    standing: TwinStanding
    nodes: tuple[NodeState, ...]
    own: frozenset[str]

    def get(self, name: str) -> NodeState:
        """One of them; UnknownNodeError says which there are."""
        for node in self.nodes:
            if node.name == name:
                return node
        names = [node.name for node in self.nodes]
        near = difflib.get_close_matches(name, names, n=1)
        hint = f"did you mean {near[0]!r}?" if near else f"it has: {', '.join(names) or 'none'}"
        raise UnknownNodeError(f"robot {self.standing.robot} has no node {name[:64]!r}; {hint}"[:500])


def nobody(robot: str, node: str) -> str | None:
    """Where nodes have no leases."""
    return None


class NodeManager:
    """All methods on the event loop."""

    def __init__(self, twins: Twins, find: FindRobot, *, holder_of: Holder = nobody) -> None:
        self._twins = twins
        self._find = find
        self._holder_of = holder_of

    def view_of(self, robot: str) -> RobotView | None:
        """The robot's link as this gateway sees it; None where it has never heard of it."""
        try:
            return self._find(robot)
        except UnknownRobotError:
            return None

    async def of_robot(self, robot: str) -> RobotNodes:
        """One robot's nodes; UnknownRobotError for one that never connected."""
        state = await self._twins.manager.state(robot)
        (sides,) = await asyncio.to_thread(_read, [state])
        return self._nodes(sides)

    async def of_many(self, selector: Selector, sees: Callable[[str], bool]) -> list[RobotNodes]:
        """The nodes of every robot that the selector names and that one sees, by robot."""
        states = await self._twins.manager.states(selector, sees, values_bytes=VALUES_BYTES)
        found = []
        for number, sides in enumerate(await asyncio.to_thread(_read, states)):
            found.append(self._nodes(sides))
            if number % ROBOTS_AT_ONCE == 0:
                await asyncio.sleep(0)
        return found

    # -- rows of the twin ------------------------------------------------------------------------------------------

    async def change(
        self, robot: str, node: str, patch: Mapping[str, Any], editor: Editor, *, expected: Expected, dry_run: bool
    ) -> Outcome:
        """Lay a merge patch over a node's row of the robot's own document.

        Raises:
            UnknownNodeError: the robot's desired state has no such node to be changed.
            TwinError, TwinChangedError, ForbiddenError: see TwinManager.edit.
        """
        found = (await self.of_robot(robot)).get(node)
        _require_wanted(found)
        edit = Edit(patch={"nodes": {node: dict(patch)}})
        return await self._twins.manager.edit(robot, edit, editor, expected=expected, dry_run=dry_run)

    async def change_many(
        self,
        selector: Selector,
        node: str,
        patch: Mapping[str, Any],
        editor: Editor,
        *,
        sees: Callable[[str], bool],
        dry_run: bool,
    ) -> list[Outcome]:
        """The same for every robot named whose desired state has that node: all of them, or none."""
        there = await self.with_node(selector, node, sees)
        chosen = {item.standing.robot for item in there if item.get(node).desired is not None}
        if not chosen:
            raise _nowhere(selector, node)
        edit = Edit(patch={"nodes": {node: dict(patch)}})
        return await self._twins.manager.edit_many(
            selector, edit, editor, sees=lambda robot: robot in chosen, dry_run=dry_run
        )

    async def with_node(self, selector: Selector, node: str, sees: Callable[[str], bool]) -> list[RobotNodes]:
        """The robots named that have such a node; UnknownNodeError where none has."""
        found = [item for item in await self.of_many(selector, sees) if any(one.name == node for one in item.nodes)]
        if not found:
            raise _nowhere(selector, node)
        return found

    async def put(
        self, robot: str, node: str, row: Mapping[str, Any], editor: Editor, *, expected: Expected, dry_run: bool
    ) -> Outcome:
        """Give the node exactly this row: what a template says of it and the row does not is taken away."""
        parse_part({"nodes": {node: dict(row)}})

        def own(state: TwinState) -> dict[str, Any]:
            below = self._below(state).get(node) or {}
            return {**dict.fromkeys(below), **row}

        return await self._rewrite(robot, node, own, editor, expected=expected, dry_run=dry_run)

    async def remove(self, robot: str, node: str, editor: Editor, *, expected: Expected, dry_run: bool) -> Outcome:
        """Take the node away from the robot, also where a template brings it."""
        _require_wanted((await self.of_robot(robot)).get(node))

        def own(state: TwinState) -> Any:
            return None if node in self._below(state) else _GONE

        return await self._rewrite(robot, node, own, editor, expected=expected, dry_run=dry_run)

    async def _rewrite(
        self,
        robot: str,
        node: str,
        row: Callable[[TwinState], Any],
        editor: Editor,
        *,
        expected: Expected,
        dry_run: bool,
    ) -> Outcome:
        """Another row in the robot's own document, as a whole; against what is there, and again where that moved."""
        for left in reversed(range(TRIES)):
            state = await self._twins.manager.state(robot)
            own = read(state.desired.own)
            nodes = dict(own.get("nodes") or {})
            wanted = row(state)
            nodes.pop(node, None)
            if wanted is not _GONE:
                nodes[node] = wanted
            document = {**own, "nodes": nodes}
            if not nodes and not own.get("nodes"):
                document.pop("nodes")
            seen = expected or (state.desired.revision, state.desired.edition)
            try:
                return await self._twins.manager.edit(
                    robot, Edit(document=document), editor, expected=seen, dry_run=dry_run
                )
            except TwinChangedError:
                if expected is not None or not left:
                    raise
        raise AssertionError("unreachable")

    def _below(self, state: TwinState) -> dict[str, Any]:
        """The nodes that templates alone give the robot."""
        robot = state.desired.robot
        named = made_of(self._twins.cache.templates.values(), robot, state.labels)
        return dict(effective(named, {}).get("nodes") or {})

    # -- both sides ------------------------------------------------------------------------------------------------

    def _nodes(self, sides: _Sides) -> RobotNodes:
        state, twin = sides.state, sides.twin
        robot, said = state.desired.robot, state.reported
        view = self.view_of(robot)
        standing = TwinStanding(
            robot=robot,
            online=view is not None and view.online,
            reported_ns=said.at_ns if said is not None else 0,
            revision=state.desired.revision,
            applied=said.applied if said is not None else 0,
            state=said.state if said is not None else "",
            message=said.message or said.code if said is not None else "",
            manages=twin.nodes is not None,
            namespace=view.robot.namespace if view is not None else f"/{robot}",
        )
        reported, desired = sides.reported, twin.nodes or {}
        nodes = [
            node_state(
                name,
                desired.get(name),
                reported.get(name),
                standing,
                holder=self._holder_of(robot, name) if name in desired and desired[name].migratable else None,
            )
            for name in sorted({*desired, *reported})
        ]
        return RobotNodes(standing=standing, nodes=tuple(nodes), own=sides.own)


_GONE = object()


@dataclass(frozen=True, slots=True)
class _Sides:
    """One robot's twin and report, read."""

    state: TwinState
    twin: Twin
    reported: Mapping[str, Mapping[str, Any]]
    own: frozenset[str]


def _read(states: Sequence[TwinState]) -> list[_Sides]:
    """The documents of some robots, in a thread; a fleet has few different ones."""
    twins: dict[bytes, Twin] = {}
    found = []
    for state in states:
        document = state.desired.document
        if document not in twins:
            twins[document] = _parsed(document)
        reported = dict(_reported(reported_values(state.reported))) if state.reported is not None else {}
        own = frozenset(orjson.loads(state.desired.own).get("nodes") or {})
        found.append(_Sides(state, twins[document], reported, own))
    return found


def _reported(values: Mapping[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    """The robot's own words, as far as they have the shape of nodes."""
    nodes = values.get("nodes")
    for name, row in nodes.items() if isinstance(nodes, dict) else ():
        if isinstance(row, dict):
            yield name, row


def _parsed(document: bytes) -> Twin:
    """A document that was checked when it was stored; one that an older gateway stored shows no nodes."""
    try:
        return parse(document)
    except TwinError:
        return Twin()


def _require_wanted(found: NodeState) -> None:
    if found.desired is None:
        raise UnknownNodeError(f"the twin of {found.robot} has no node {found.name!r}: the robot runs it by itself")


def _nowhere(selector: Selector, node: str) -> UnknownNodeError:
    return UnknownNodeError(f"no robot of {selector.text or 'all'!r} has a node {node[:64]!r}")
