"""Bodies and answers of the rollouts' routes."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from gateway.api.models.base import Exact

__all__ = ["Resume", "Rollout", "RolloutDetail", "RolloutList", "RolloutRequest", "Why"]

State = Literal["running", "paused", "halted", "done", "aborted"]
MemberState = Literal["waiting", "starting", "updating", "done", "failed", "unreached"]
DAY_S = 86_400.0


class RolloutRequest(Exact):
    """A version for the robots that the selector names. `node`: the node's name in the twin, where it is a node's.

    `bundle`: the node's bundle, by default its own name. Waves are numbers of robots, or percentages of all.
    """

    version: str = Field(max_length=40)
    selector: str = Field(max_length=4096)
    node: str = Field(default="", max_length=255)
    bundle: str = Field(default="", max_length=63)
    waves: list[str] = Field(default=["1", "10%", "50%", "100%"], min_length=1, max_length=32)
    max_failure_rate: float = Field(default=0.1, ge=0.0, le=1.0, allow_inf_nan=False)
    health_s: float = Field(default=600.0, ge=1.0, le=DAY_S, allow_inf_nan=False)
    steady_s: float = Field(default=10.0, ge=0.0, le=3600.0, allow_inf_nan=False)
    offline_s: float = Field(default=300.0, ge=1.0, le=DAY_S, allow_inf_nan=False)
    give_up_s: float = Field(default=7 * DAY_S, ge=60.0, le=90 * DAY_S, allow_inf_nan=False)
    dry_run: bool = False


class Why(Exact):
    """Why, for whoever looks later."""

    reason: str = Field(default="", max_length=500)


class Resume(Exact):
    """Go on; with another version from the first wave."""

    version: str = Field(default="", max_length=40)


class Wave(Exact):
    """One wave and how far it is."""

    wave: int
    size: int
    in_flight: int
    done: int
    failed: int


class Rollout(Exact):
    """A rollout; `counts` are robots by state."""

    id: str
    state: State
    reason: str
    kind: Literal["agent", "node"]
    node: str
    bundle: str
    version: str
    selector: str
    max_failure_rate: float
    health_s: float
    steady_s: float
    offline_s: float
    give_up_s: float
    robots: int
    wave: int
    waves: list[Wave]
    counts: dict[MemberState, int]
    created: str
    created_by: str
    changed: str
    dry_run: bool


class RolloutRobot(Exact):
    """One robot of it; `wave` is 0 before its turn."""

    robot: str
    state: MemberState
    wave: int
    since: str
    reason: str


class RolloutDetail(Rollout):
    """With its robots, in the order of their turns."""

    members: list[RolloutRobot]


class RolloutList(Exact):
    """The newest rollouts, newest first."""

    rollouts: list[Rollout]
    next: str | None
