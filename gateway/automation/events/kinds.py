"""The table of what can happen: every event names a row of it."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["EVENT_KINDS", "EventKind", "event_kind"]


@dataclass(frozen=True, slots=True)
class EventKind:
    """One row: what happened, and what its data tell."""

    name: str
    meaning: str
    data: tuple[str, ...]


_ALERT = ("alert", "cause", "severity", "state", "title", "reason", "times", "quiet", "what", "by", "revision")

EVENT_KINDS: tuple[EventKind, ...] = (
    EventKind("robot.online", "a robot's link is whole", ("hostname", "agent_version")),
    EventKind("robot.offline", "a robot's link ended", ()),
    EventKind("node.state", "a node is in another state", ("node", "state", "before", "why", "restarts")),
    EventKind("node.crashed", "a node ended unasked", ("node", "restarts", "crashes")),
    EventKind("node.quarantined", "a node crashed too often, and is left alone for a while", ("node", "restarts")),
    EventKind("command.ended", "a kept command is over", ("command", "kind", "state", "code", "issued_by")),
    EventKind("twin.applied", "a robot lives by its desired state", ("revision",)),
    EventKind("twin.refused", "a robot refuses its desired state", ("revision", "code", "message")),
    EventKind("twin.reverted", "a robot went back to what it was before", ("revision", "code", "message")),
    EventKind(
        "twin.drifted",
        "a robot whose nodes were as desired, and without a change are so no more",
        ("revision", "count", "nodes"),
    ),
    EventKind("twin.in_step", "all nodes of a robot are as desired again", ("revision",)),
    EventKind("rollout.changed", "a rollout is in another state", ("rollout", "state", "reason")),
    EventKind("recording.stored", "a recording's file is here", ("recording", "size_bytes")),
    EventKind("recording.failed", "a recording will not come", ("recording", "code", "message")),
    EventKind("lease.taken", "somebody drives a robot", ("holder",)),
    EventKind("lease.ended", "nobody drives it any more", ("holder",)),
    EventKind("alert.opened", "an alert opened, or began again", _ALERT),
    EventKind("alert.acknowledged", "somebody knows of an alert", _ALERT),
    EventKind("alert.resolved", "an alert is over", _ALERT),
    EventKind("alert.changed", "an alert got worse, quiet or loud, or somebody did something about it", _ALERT),
    EventKind(
        "function.canary",
        "a canary of a function began, went on, was promoted, rolled back or cancelled",
        ("function", "alias", "version", "stable", "weight", "state", "reason"),
    ),
    EventKind("journal.lost", "so many events could not be kept", ("count",)),
)
_BY_NAME = {row.name: row for row in EVENT_KINDS}


def event_kind(name: str) -> EventKind:
    """The row of that name; KeyError for one that the table lacks, which is a mistake of ours."""
    return _BY_NAME[name]
