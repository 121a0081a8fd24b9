"""A robot's node, desired and reported: compared, with why they differ. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from metaros.fleet.twin.document import NodeSpec

__all__ = ["VERBS", "Difference", "NodeState", "TwinStanding", "node_state"]

VERBS = ("start", "stop", "restart", "retry", "signal")
RESTING = ("stopped", "quarantined", "ended")
_EXITED = "exited"  # how the supervisor calls an end with code 0


@dataclass(frozen=True, slots=True, kw_only=True)
class TwinStanding:
    """How a robot stands to its desired state, as far as every node of it is concerned."""

    robot: str
    online: bool = False
    reported_ns: int = 0  # when it said what it is; 0 = never
    revision: int = 0
    applied: int = 0
    state: str = ""  # of its last report
    message: str = ""
    manages: bool = True  # whether the twin says anything of nodes; else the robot's own table holds
    namespace: str = "/"

    @property
    def in_step(self) -> bool:
        """Whether the robot lives by what is desired."""
        return self.applied == self.revision and self.state in ("", "applied")

    @property
    def why(self) -> str:
        """In words why the robot may not be what is desired; "" where nothing of the twin stands in the way."""
        if not self.reported_ns:
            return "the robot has never reported what it runs"
        if self.state == "refused" and not self.in_step:
            return f"the robot refused revision {self.revision}: {self.message}"
        if self.state == "reverted" and not self.in_step:
            return f"the robot went back from revision {self.revision}: {self.message}"
        if not self.online:
            return "the robot is offline; it takes this when it is back"
        if not self.in_step:
            return f"revision {self.revision} is on its way"
        return ""


@dataclass(frozen=True, slots=True)
class Difference:
    """One thing that is not as desired."""

    what: str  # state, version, nice, absent, extra
    desired: Any
    reported: Any
    why: str


@dataclass(frozen=True, slots=True, kw_only=True)
class NodeState:
    """One node of one robot. `wanted` is running, stopped, standby (another robot runs it), or absent."""

    robot: str
    name: str
    ros_name: str
    online: bool
    state: str
    wanted: str
    desired: NodeSpec | None
    reported: Mapping[str, Any] | None
    reported_ns: int = 0
    holder: str | None = None
    differs: tuple[Difference, ...] = field(default=())


def node_state(
    name: str,
    desired: NodeSpec | None,
    reported: Mapping[str, Any] | None,
    standing: TwinStanding,
    *,
    holder: str | None = None,
) -> NodeState:
    """Both sides as one. `holder`: the robot that has the lease of a migratable node."""
    wanted = _wanted(desired, standing, holder)
    state = str(reported.get("state", "unknown")) if reported is not None else "unknown"
    return NodeState(
        robot=standing.robot,
        name=name,
        ros_name=f"{standing.namespace.rstrip('/')}/{name}",
        online=standing.online,
        state=state,
        wanted=wanted,
        desired=desired,
        reported=reported,
        reported_ns=standing.reported_ns,
        holder=holder,
        differs=tuple(_differences(desired, reported, standing, wanted, holder)),
    )


def _wanted(desired: NodeSpec | None, standing: TwinStanding, holder: str | None) -> str:
    if desired is None:
        return "absent"
    if not desired.run:
        return "stopped"
    return "standby" if desired.migratable and holder not in (None, standing.robot) else "running"


def _differences(
    desired: NodeSpec | None,
    reported: Mapping[str, Any] | None,
    standing: TwinStanding,
    wanted: str,
    holder: str | None,
) -> Iterator[Difference]:
    if desired is None:
        if reported is not None and standing.manages:
            yield Difference("extra", None, reported.get("state"), standing.why or "it is about to end")
        return
    if reported is None:
        if wanted != "stopped":
            yield Difference("absent", wanted, None, standing.why or "the robot has not taken it yet")
        return
    if not _as_wanted(desired, reported, wanted):
        why = _why(reported, wanted, standing, holder)
        yield Difference("state", wanted, reported.get("state"), why)
    version = reported.get("version", "")
    if desired.version and version != desired.version:
        yield Difference("version", desired.version, version or None, _update(reported) or standing.why or "not yet")
    nice = reported.get("nice")
    if nice is not None and nice != desired.nice:
        yield Difference("nice", desired.nice, nice, standing.why or "not yet")


def _as_wanted(desired: NodeSpec, reported: Mapping[str, Any], wanted: str) -> bool:
    state = reported.get("state")
    if wanted == "running":
        done = state == "ended" and desired.restart != "always" and reported.get("last_exit") == _EXITED
        return state == "running" or done
    return state in RESTING  # of those that are not to run: nothing runs


def _why(reported: Mapping[str, Any], wanted: str, standing: TwinStanding, holder: str | None) -> str:
    """Why a node is not in the state that is wanted: its own reason before the robot's."""
    if wanted != "running":
        return standing.why or "it is about to end"
    state, last = reported.get("state"), reported.get("last_exit", "")
    because = f": {last}" if last else ""
    if state == "quarantined":
        return f"quarantined after {reported.get('crashes', 0)} crashes{because}"
    if state == "blocked":
        return f"waits for {reported.get('waits_for', 'other nodes')}"
    if state == "hung":
        return "it lives and gives no sign of it"
    if state == "waiting" and last:
        return f"it is started again soon{because}"
    if state == "ended":
        return f"it ended{because}"
    if state == "stopped":
        return _why_stopped(reported, standing, holder)
    return _update(reported) or str(reported.get("why", "")) or str(last) or standing.why or "not yet"


def _why_stopped(reported: Mapping[str, Any], standing: TwinStanding, holder: str | None) -> str:
    why = reported.get("why", "")
    if why == "by hand":
        return "stopped by hand on the robot"
    if why == "no lease":
        return "waits for its lease" if holder is None else f"waits for its lease; {holder} runs it"
    return standing.why or str(why) or "it is about to start"


def _update(reported: Mapping[str, Any]) -> str:
    """How the update of its bundle stands, in words."""
    update = reported.get("update")
    if not isinstance(update, Mapping) or update.get("state") in (None, "", "idle", "healthy"):
        return ""
    message = update.get("message") or update.get("code")
    return f"{update['state']} {update.get('version', '')}".strip() + (f": {message}" if message else "")
