"""Commands in the API's documents: what a request may hold and what answers it."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field

from gateway.api.models.base import Exact
from metaros.limits import LIMITS

__all__ = ["Command", "CommandList", "CommandRequest", "FleetCommandRequest", "FleetCommands"]

State = Literal["issued", "delivered", "running", "done", "failed", "expired", "cancelled"]


class CommandRequest(Exact):
    """What a robot is to do. `durable`: it may come later, and is delivered until it expires.

    `sent_ns` is the wall clock of who made it, for what moves the robot; 0 is now.
    """

    kind: Literal["publish", "call_service", "node_verb", "read_log", "save_recording", "set_uplink"]
    request: dict[str, Any] = Field(default_factory=dict)
    durable: bool = False
    expires_s: float = Field(default=LIMITS.command_expires_s, gt=0, le=LIMITS.command_expires_most_s)
    timeout_s: float = Field(default=LIMITS.command_timeout_s, gt=0, le=120)
    sent_ns: int = Field(default=0, ge=0, lt=2**63)


class FleetCommandRequest(CommandRequest):
    """The same for every robot that the selector names: one command each. `dry_run` only tells which."""

    selector: str = Field(min_length=1, max_length=4096)
    dry_run: bool = False


class Command(Exact):
    """A command and how far it is. Times are null until they came."""

    id: str
    robot: str
    kind: str
    request: Any
    state: State
    durable: bool
    issued_by: str
    idempotency_key: str | None
    timeout_s: float
    issued: str
    expires: str | None
    delivered: str | None
    running: str | None
    ended: str | None
    code: str
    message: str
    result: Any


class CommandList(Exact):
    """A page, newest first; `next` is the `before` of the page after it."""

    commands: list[Command]
    next: str | None


class FleetCommands(Exact):
    """One command for each robot that was named, or why that robot got none."""

    commands: list[Command]
    refused: dict[str, dict[str, str]]
    robots: list[str]
