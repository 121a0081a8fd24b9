"""The table of causes: what an alert of each is called, and which other alerts of the same robot it explains."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass

from gateway.domain.alert import Alert, rank
from gateway.domain.automation.event import like

__all__ = ["CAUSES", "TOO_MANY", "Cause", "explains", "title_of"]

TOO_MANY = "too_many"


@dataclass(frozen=True, slots=True, kw_only=True)
class Cause:
    """One row. What it `explains` (globs of causes) stays quiet while it lasts.

    `whatever` also explains what is worse than itself. Of a `node` an alert explains the topics that it publishes only.
    """

    name: str
    title: str
    explains: tuple[str, ...] = ()
    whatever: bool = False
    node: bool = False


CAUSES: tuple[Cause, ...] = (
    Cause(name="offline", title="Robot is offline", explains=("*",), whatever=True),
    Cause(name="link", title="The link comes and goes", explains=("silence", "rate", "sequence")),
    Cause(name="late", title="The robot's data comes late", explains=("silence", "rate")),
    Cause(name="crash", title="A node crashes", explains=("silence", "rate", "frozen"), node=True),
    Cause(name="host", title="The robot's computer is at its limit", explains=("rate",)),
    Cause(name="clock", title="The robot's clock is off"),
    Cause(name="disk", title="The disk is nearly full"),
    Cause(name="silence", title="A topic is silent"),
    Cause(name="rate", title="A topic's rate is off"),
    Cause(name="frozen", title="A value does not change any more"),
    Cause(name="sequence", title="Samples are missing"),
    Cause(name="battery", title="Battery"),
    Cause(name="heat", title="Too hot"),
    Cause(name="change", title="A value is not as usual"),
    Cause(name="vibration", title="A value shakes more, or less, than usual"),
    Cause(name="together", title="Values do not go together as usual"),
    Cause(name="cohort", title="Unlike the other robots of its kind"),
    Cause(name=TOO_MANY, title="More is wrong than there can be alerts"),
)
_BY_NAME = {row.name: row for row in CAUSES}


def title_of(cause: str) -> str:
    """What an alert of that cause is called; the cause itself where the table lacks it."""
    row = _BY_NAME.get(cause)
    return row.title if row is not None else cause.replace("_", " ").capitalize()


def explains(one: Alert, other: Alert, topics_of: Callable[[str, str], Collection[str]]) -> bool:
    """Whether `one` is why there is the `other`, both of one robot.

    `topics_of` says what a robot's node publishes, as far as anybody knows.
    """
    row = _BY_NAME.get(one.cause)
    if row is None or one.cause == other.cause or other.cause in ("offline", TOO_MANY):
        return False
    if not any(like(other.cause, glob) for glob in row.explains):
        return False
    if not row.whatever and rank(other.severity) > rank(one.severity):
        return False
    if not row.node:
        return True
    nodes = {item.finding.series for item in one.findings if item.active}
    topics = {topic for node in nodes for topic in topics_of(one.robot, node)}
    wrong = [item.finding.series for item in other.findings if item.active]
    return bool(wrong) and all(series in topics for series in wrong)
