"""Records what other features report as events of the journal; wiring/gateway.py hands these methods to them."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import islice
from typing import Any

import orjson

from gateway.automation.events.journal import Database, EventJournal, Within
from gateway.domain.fleet.command import DONE, Command
from gateway.domain.fleet.recording import STORED, Recording
from gateway.domain.fleet.rollout import Rollout
from gateway.domain.fleet.twin import Reported
from gateway.domain.robot import Robot
from metaros.clock import Clock
from metaros.fleet.twin.tables import MAX_NODES

__all__ = ["EventRecorder"]

TEXT_CHARS = 500
STATE_CHARS = 32
ABSENT = "absent"  # a node that the robot does not have
SETTLED = {"applied": "twin.applied", "refused": "twin.refused", "reverted": "twin.reverted"}


class EventRecorder:
    """The journal and its writers; all methods on the event loop."""

    def __init__(self, database: Database, *, clock: Clock, within: Within | None = None) -> None:
        self.journal = EventJournal(database, clock=clock, within=within)

    async def start(self) -> None:
        """Know where the journal stands."""
        await self.journal.start()

    async def run(self) -> None:
        """Until cancelled."""
        await self.journal.run()

    async def close(self) -> None:
        """Store what was told last."""
        await self.journal.close()

    def on_online(self, robot: Robot, online: bool) -> None:
        """A robot's link is whole, or ended."""
        facts = {"hostname": robot.hostname, "agent_version": robot.agent_version} if online else {}
        self.journal.emit("robot.online" if online else "robot.offline", robot.id, facts)

    def on_lease(self, robot: str, holder: str, taken: bool) -> None:
        """Somebody drives a robot, or does no more."""
        self.journal.emit("lease.taken" if taken else "lease.ended", robot, {"holder": holder})

    def on_command(self, command: Command) -> None:
        """A command is over. What was published well is in the history of commands, and is no event."""
        if command.kind == "publish" and command.state == DONE:
            return
        told = {"command": command.id, "kind": command.kind, "state": command.state, "code": command.code}
        self.journal.emit("command.ended", command.robot, {**told, "issued_by": command.issued_by})

    def on_recording(self, recording: Recording) -> None:
        """A recording came to its end."""
        told: dict[str, Any] = {"recording": recording.id}
        if recording.state == STORED:
            self.journal.emit("recording.stored", recording.robot, {**told, "size_bytes": recording.size_bytes})
        else:
            told |= {"code": recording.code, "message": recording.message[:TEXT_CHARS]}
            self.journal.emit("recording.failed", recording.robot, told)

    def on_rollout(self, rollout: Rollout) -> None:
        """A rollout is in another state."""
        told = {"rollout": rollout.id, "state": rollout.state, "reason": rollout.reason[:TEXT_CHARS]}
        self.journal.emit("rollout.changed", "", told)

    def on_twin(self, before: Reported | None, after: Reported) -> None:
        """A robot reported what it is, and what it reported before."""
        kind = SETTLED.get(after.state)
        same = before is not None and (before.state, before.revision) == (after.state, after.revision)
        if kind is not None and after.revision and not same:
            told: dict[str, Any] = {"revision": after.revision}
            if kind != "twin.applied":
                told |= {"code": after.code, "message": after.message[:TEXT_CHARS]}
            self.journal.emit(kind, after.robot, told)
        if before is not None and before.reported and before.reported != after.reported:
            was, now = _nodes_of(before), _nodes_of(after)
            if was is not None and now is not None:
                self._nodes(after.robot, was, now)

    def _nodes(self, robot: str, before: Mapping[str, Any], after: Mapping[str, Any]) -> None:
        for name in sorted(before.keys() - after.keys())[:MAX_NODES]:
            self._node_state(robot, name, before[name], {"state": ABSENT})
        for name, row in islice(after.items(), MAX_NODES):
            known = before.get(name)
            if not isinstance(row, Mapping):
                continue
            self._node_state(robot, name, known, row)
            if not isinstance(known, Mapping):
                continue
            crashes = _count(row.get("crashes"))
            told = {"node": name, "restarts": _count(row.get("restarts"))}
            if crashes > _count(known.get("crashes")):
                self.journal.emit("node.crashed", robot, {**told, "crashes": crashes})
            if row.get("quarantined") is True and known.get("quarantined") is not True:
                self.journal.emit("node.quarantined", robot, told)

    def _node_state(self, robot: str, node: str, before: Any, row: Mapping[str, Any]) -> None:
        """A node is in a state; told where it was in another one."""
        was, now = _state(before), _state(row)
        if now and was != now:
            told = {"node": node, "state": now, "before": was or ABSENT, "why": _why(row)}
            self.journal.emit("node.state", robot, {**told, "restarts": _count(row.get("restarts"))})


def _nodes_of(item: Reported) -> Mapping[str, Any] | None:
    """The nodes that a robot reported; None where it left them out, or that is no JSON of the kind."""
    try:
        found = orjson.loads(item.reported)
    except orjson.JSONDecodeError:
        return None
    nodes = found.get("nodes") if isinstance(found, dict) else None
    return nodes if isinstance(nodes, dict) else None


def _state(row: Any) -> str:
    found = row.get("state") if isinstance(row, Mapping) else None
    return found[:STATE_CHARS] if isinstance(found, str) else ""


def _why(row: Mapping[str, Any]) -> str:
    """What the robot says of it; where that is nothing, how the node ended."""
    return str(row.get("why") or row.get("last_exit") or "")[:TEXT_CHARS]


def _count(value: Any) -> int:
    return value if isinstance(value, int) else 0
