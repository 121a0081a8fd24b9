"""Bodies and answers about robots' nodes, for OpenAPI and for checking."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import ConfigDict, Field

from gateway.api.models.base import Exact, Model
from gateway.api.models.twin import Change

__all__ = [
    "Crashes",
    "Lifecycle",
    "LifecycleChange",
    "LifecycleChanged",
    "LogPage",
    "Node",
    "NodeList",
    "NodeResult",
    "NodeResults",
    "Parameters",
    "ParametersChange",
    "ParametersChanged",
    "RobotNodes",
    "VerbForMany",
    "VerbForOne",
]

Outcome = Literal["done", "pending", "failed"]


class Difference(Model):
    """One thing that is not as desired: state, version, nice, absent, extra; and why, in words."""

    what: str
    desired: Any
    reported: Any
    why: str


class NodeUpdate(Model):
    """How the update of a node's bundle stands."""

    state: str
    version: str
    code: str
    message: str


class ReportedNode(Model):
    """What the robot says of a node. `safe_stop`: of a critical one that died, how the robot's stop went."""

    state: str
    why: str
    pid: int | None
    restarts: int
    since: str | None
    last_exit: str
    version: str
    waits_for: list[str]
    lease_id: str
    nice: int | None
    quarantined: bool
    crashes: int
    safe_stop: str
    update: NodeUpdate | None


class Node(Model):
    """One node of one robot: desired and reported. `state` is the reported one; `holder` has a migratable one's lease.

    `wanted` is running, stopped, standby (another robot runs it) or absent (the twin does not name it).
    """

    robot: str
    name: str
    ros_name: str
    online: bool
    state: str
    wanted: str
    in_step: bool
    differs: list[Difference]
    in_own: bool
    desired: dict[str, Any] | None
    reported: ReportedNode | None
    reported_at: str | None
    holder: str | None


class RobotNodes(Model):
    """One robot's nodes, and how the robot stands to its twin."""

    robot: str
    online: bool
    namespace: str
    revision: int
    applied: int
    in_step: bool
    nodes: list[Node]


class NodeList(Model):
    """Nodes of many robots; `more`: there are further ones than are listed."""

    nodes: list[Node]
    more: bool


class VerbForOne(Exact):
    """What a verb needs: `signal` its number, the others nothing."""

    signal: int = Field(default=0, ge=0, le=64, strict=True)


class VerbForMany(VerbForOne):
    """Which robots, and which of their nodes."""

    selector: str = Field(max_length=4096)
    node: str = Field(min_length=1, max_length=64)


class NodeResult(Model):
    """What became of a verb at one robot.

    pending: the twin has it, the robot does it when it gets it; `told`: the robot itself has done it.
    """

    robot: str
    node: str
    verb: str
    dry_run: bool
    outcome: Outcome
    told: bool
    changed: bool
    revision: int | None
    changes: list[Change]
    code: str
    message: str


class NodeResults(Model):
    """The same, robot by robot."""

    verb: str
    node: str
    dry_run: bool
    robots: int
    done: int
    results: list[NodeResult]


class LogLine(Model):
    """One line; `at_ns` is text, as no browser counts so far."""

    at: str | None
    at_ns: str
    text: str


class LogPage(Model):
    """Lines, oldest first, and the cursor to go on with in the same direction."""

    lines: list[LogLine]
    cursor: str
    more: bool


class Crash(Model):
    """How a node ended, with its last words."""

    at: str | None
    reason: str
    pid: int | None
    ran_s: float | None
    version: str
    argv: list[str]
    env: dict[str, str]
    lines: list[str]


class Crashes(Model):
    """The newest first."""

    crashes: list[Crash]


class Bounds(Model):
    """Both ends included; a step of 0: any value between them."""

    model_config = ConfigDict(populate_by_name=True)

    from_: float = Field(alias="from")
    to: float
    step: float


class Parameter(Model):
    """One parameter. `desired` is there where the twin names it. Whole numbers beyond 2^53 are text."""

    name: str
    type: str
    value: Any
    desired: Any = None
    description: str
    constraints: str
    read_only: bool
    dynamic_typing: bool
    integer_range: Bounds | None
    floating_point_range: Bounds | None


class Parameters(Model):
    """A node's parameters, by name; `node` is its full ROS name."""

    robot: str
    node: str
    parameters: list[Parameter]


class ParametersChange(Exact):
    """Values by name, null to take one away; `keep`: the twin has them too from then on."""

    parameters: dict[str, Any] = Field(min_length=1, max_length=256)
    keep: bool = Field(default=False, strict=True)


class ParameterResult(Model):
    """What became of one value."""

    name: str
    successful: bool
    reason: str


class ParametersChanged(Model):
    """What became of each; `revision` is the twin's where that has changed."""

    robot: str
    node: str
    dry_run: bool
    results: list[ParameterResult]
    revision: int | None


class Lifecycle(Model):
    """A managed node's state, what the twin wants of it, and where it may go from there."""

    robot: str
    node: str
    managed: bool
    state: str
    wanted: str | None
    transitions: list[str]


class LifecycleChange(Exact):
    """A transition; `keep`: the twin names the new state from then on."""

    transition: Literal["configure", "activate", "deactivate", "cleanup", "shutdown"]
    keep: bool = Field(default=False, strict=True)


class LifecycleChanged(Lifecycle):
    """The same after it; `success`: the node made the transition, or with a dry run: it could."""

    dry_run: bool
    success: bool
    revision: int | None
