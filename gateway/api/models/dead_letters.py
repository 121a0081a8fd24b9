"""Bodies and answers of the routes for dead letters and replays."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from gateway.api.models.base import Exact

__all__ = ["DeadLetter", "DeadLetterList", "Dropped", "Redrive", "Redriven", "Replay", "ReplayList", "ReplayRequest"]

Id = Annotated[str, Field(min_length=1, max_length=64)]


class DeadLetter(Exact):
    """What could not be delivered. `payload` is what its target would have got, as text, cut at 16 KiB."""

    id: str
    kind: str
    target: str
    happening: str
    robot: str
    code: str
    message: str
    attempts: int
    tries: int
    redrives: int
    born: str
    ended: str
    payload: str | None
    truncated: bool


class DeadLetterList(Exact):
    """The newest first; `next` is the `before` of the next page, null at the end. `total` is of all that there are."""

    dead_letters: list[DeadLetter]
    total: int
    next: str | None


class Redrive(Exact):
    """Which dead letters: some by their ids, or all of a kind or target, or with `all` every one."""

    ids: list[Id] = Field(default_factory=list, max_length=1000)
    kind: str = Field(default="", max_length=64)
    target: str = Field(default="", max_length=256)
    all: bool = False


class Redriven(Exact):
    """How many are delivered again."""

    redriven: int


class Dropped(Exact):
    """How many are gone for good."""

    dropped: int


class ReplayRequest(Exact):
    """What happened in a span is given to a function once more: what fits the `pattern`, of these types and robots."""

    start: str = Field(alias="from", min_length=1, max_length=64)
    until: str = Field(default="now", max_length=64)
    pattern: dict[str, Any] | None = None
    types: list[Annotated[str, Field(max_length=256)]] = Field(default_factory=list, max_length=64)
    qualifier: str = Field(default="", max_length=128)


class Replay(Exact):
    """How far a replay is: `seen` happenings were looked at, and `put` of them given to the function."""

    id: str
    function: str
    state: Literal["running", "done", "stopped", "failed"]
    start: str
    until: str
    seen: int
    put: int
    message: str


class ReplayList(Exact):
    """Those under way first, then the newest."""

    replays: list[Replay]
