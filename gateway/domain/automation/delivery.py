"""An event or an invocation on its way to one target, from its acceptance to its one end."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, Protocol, TypeGuard

__all__ = [
    "DEAD",
    "DONE",
    "LEASED",
    "LOST",
    "TOO_OLD",
    "WAITING",
    "Backlog",
    "Backoff",
    "BatchHandler",
    "Dead",
    "DeadFilter",
    "Delivery",
    "Done",
    "Handler",
    "Policy",
    "Put",
    "Result",
    "Retry",
    "Share",
    "Totals",
    "takes_batches",
]

WAITING, LEASED, DONE, DEAD = "waiting", "leased", "done", "dead"
TOO_OLD, LOST = "too_old", "lost"  # codes of the dead that no handler gave up
Backoff = Literal["exponential", "lambda"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Policy:
    """How often and how long a delivery is tried. `most_attempts` counts failures of the target itself; what could
    not be tried (throttled, robot away) is tried again until `most_age_s`.
    """

    most_attempts: int = 3
    most_age_s: float = 6 * 3600.0
    backoff: Backoff = "exponential"
    first_s: float = 1.0
    most_s: float = 300.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Put:
    """What is to be delivered.

    `kind` says which handler delivers it, `target` to which of its targets (a function's name and qualifier, a
    rule's name and target id, a mapping's UUID). Of the same `target` and `dedup` one is delivered, the first.
    `payload` is what the target gets, `context` what its handler needs besides (JSON). `event_id` is the id of what
    set it off, "" for an invocation by hand. `due_ns` 0: now.
    """

    kind: str
    target: str
    payload: bytes
    event_id: str = ""
    robot: str = ""
    dedup: str = ""
    due_ns: int = 0
    context: Mapping[str, Any] = field(default_factory=dict)
    policy: Policy = Policy()


@dataclass(frozen=True, slots=True, kw_only=True)
class Delivery:
    """A Put as it is stored. `born_ns` is when it was accepted, `expires_ns` when it is too old.

    `tries` are its leases, of which `attempts` failed by the target's fault since it was accepted or redriven, and
    `losses` had no outcome, since their gateway died. `code` and `message` are those of the last failure.
    """

    id: str
    put: Put
    state: str
    born_ns: int
    due_ns: int
    expires_ns: int = 0
    attempts: int = 0
    tries: int = 0
    losses: int = 0
    redrives: int = 0
    code: str = ""
    message: str = ""
    ended_ns: int = 0


@dataclass(frozen=True, slots=True)
class Done:
    """It is delivered; `puts` are stored together with that."""

    note: str = ""
    puts: Sequence[Put] = ()


@dataclass(frozen=True, slots=True)
class Retry:
    """It failed and is tried again, in `after_s` or by its policy; `counts` unless the target was never reached."""

    code: str
    message: str = ""
    after_s: float | None = None
    counts: bool = True


@dataclass(frozen=True, slots=True)
class Dead:
    """It never can be delivered: it is kept among the dead letters."""

    code: str
    message: str = ""


Result = Done | Retry | Dead


class Handler(Protocol):
    """Delivers what is of one kind. All of it runs on the event loop."""

    def room(self, target: str | None = None) -> int:
        """How many more deliveries it takes now: in all, or for one target. Those it was given count already."""

    def timeout_s(self, target: str) -> float:
        """After so long a call is given up, and counts as a failed attempt."""

    async def deliver(self, delivery: Delivery) -> Result:
        """Deliver it once. What it raises is a failed attempt."""

    def ended(self, delivery: Delivery, result: Done | Dead) -> Sequence[Put]:
        """What is to be put as it comes to its end, also where the queue itself ends it; stored together with that."""


class BatchHandler(Handler, Protocol):
    """Delivers several of one target at a time; then `deliver` is never called."""

    def batch(self, target: str) -> int:
        """The most deliveries of one call; `room` counts calls."""

    async def deliver_many(self, deliveries: Sequence[Delivery]) -> Sequence[Result]:
        """Deliver them once, in this order; one result for each."""


def takes_batches(handler: Handler) -> TypeGuard[BatchHandler]:
    """Whether a handler is of that kind."""
    return hasattr(handler, "deliver_many")


@dataclass(frozen=True, slots=True, kw_only=True)
class DeadFilter:
    """Which dead letters; none of `ids` is all. `robots` are those in scope (None: all, and what is of no robot).

    `from_ns` and `to_ns` (exclusive) are when they came to their end.
    """

    ids: tuple[str, ...] = ()
    kind: str = ""
    target: str = ""
    code: str = ""
    robots: frozenset[str] | None = None
    from_ns: int = 0
    to_ns: int = 1 << 62


@dataclass(frozen=True, slots=True)
class Share:
    """How much of a table is in use."""

    rows: int = 0
    size_bytes: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Totals:
    """What the queue holds: `live` is what waits or is under way, `done` what is remembered for its dedup."""

    live: Share = Share()
    dead: Share = Share()
    done: Share = Share()
    gateway_events: Share = Share()


@dataclass(frozen=True, slots=True, kw_only=True)
class Backlog:
    """What one target has; counts end at a bound. `oldest_ns` is when the longest due was due, 0 for none."""

    waiting: int = 0
    leased: int = 0
    dead: int = 0
    oldest_ns: int = 0
