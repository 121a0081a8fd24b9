"""Alerts as the clients return them, from REST's documents and from gRPC's messages."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from datetime import datetime
from typing import Any

from metaros._proto import alerts_pb2

__all__ = ["Alert", "AlertChange", "AlertFinding", "AlertRemark"]

Document = Mapping[str, Any]
_TIMES = ("opened", "first", "changed", "seen", "resolved", "acknowledged")
_MEASURED = ("value", "low", "high")


@dataclass(frozen=True, slots=True, kw_only=True)
class AlertFinding:
    """One thing of an alert that was found: since when, by the robot's clock, and what was expected."""

    detector: str
    series: str
    severity: str
    score: float
    value: float | None
    low: float | None
    high: float | None
    reason: str
    at_ns: int
    active: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class AlertRemark:
    """What somebody said or did: `kind` is comment, acknowledged, assigned, normal, resolved …"""

    number: int
    at_ns: int
    by: str
    kind: str
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Alert:
    """An alert: `state` is open, acknowledged or resolved; `severity` info, warning or error.

    `first_ns` is the stamp of what opened it, by the robot's clock; other times are the gateway's, 0 where it has not
    happened. `silence` and `inhibited_by` say why nobody is told of it. Findings and remarks come with `alerts.get`.
    """

    id: str
    robot: str
    cause: str
    state: str
    severity: str
    title: str
    reason: str
    series: str
    detector: str
    score: float
    value: float | None
    low: float | None
    high: float | None
    opened_ns: int
    first_ns: int
    changed_ns: int
    seen_ns: int
    resolved_ns: int
    resolved_by: str
    acknowledged_ns: int
    acknowledged_by: str
    assignee: str
    times: int
    clip: str
    inhibited_by: str
    silence: str
    gateway: str
    revision: int
    path: str
    findings: tuple[AlertFinding, ...] = ()
    remarks: tuple[AlertRemark, ...] = ()

    @property
    def unresolved(self) -> bool:
        """Whether it goes on."""
        return self.state != "resolved"

    @property
    def quiet(self) -> bool:
        """Whether nobody is told of it."""
        return bool(self.inhibited_by or self.silence)

    @classmethod
    def of(cls, document: Document) -> Alert:
        """From REST's."""
        times = {f"{name}_ns": _ns(document[name]) for name in _TIMES}
        plain: dict[str, Any] = {name: document[name] for name in _PLAIN if name not in times}
        findings = tuple(_finding(item) for item in document.get("findings", ()))
        remarks = tuple(_remark(item) for item in document.get("remarks", ()))
        return cls(**plain | times, findings=findings, remarks=remarks)

    @classmethod
    def of_message(cls, message: alerts_pb2.Alert) -> Alert:
        """From gRPC's."""
        given = {name: getattr(message, name) for name in _PLAIN}
        return cls(**{**given, **{name: given[name] if message.HasField(name) else None for name in _MEASURED}})


_PLAIN = tuple(item.name for item in fields(Alert) if item.name not in ("findings", "remarks"))


@dataclass(frozen=True, slots=True)
class AlertChange:
    """`change` is what happened: `is` of those that were when it began, then opened, escalated, acknowledged, changed,
    resolved. After a loss of the connection those that are come again.
    """

    change: str
    alert: Alert


def _finding(item: Document) -> AlertFinding:
    names = ("detector", "series", "severity", "score", *_MEASURED, "reason", "active")
    return AlertFinding(**{name: item[name] for name in names}, at_ns=_ns(item["at"]))


def _remark(item: Document) -> AlertRemark:
    return AlertRemark(**{name: item[name] for name in ("number", "by", "kind", "text")}, at_ns=_ns(item["at"]))


def _ns(time: str | None) -> int:
    return round(datetime.fromisoformat(time).timestamp() * 1e3) * 1_000_000 if time else 0
