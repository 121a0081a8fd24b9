"""What a notice says: an alert as a CloudEvents 1.0 document, or as words in a mail."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from email.message import EmailMessage
from email.policy import SMTP
from typing import Any, Literal

import orjson

from gateway.alerting.alerts.links import alert_path, moment
from gateway.alerting.alerts.notices.route import Mailbox, Route
from gateway.domain.alert import Alert

__all__ = ["Notice", "Stage", "cloud_event", "event_bytes", "mail_bytes", "test_event"]

Stage = Literal["opened", "acknowledged", "resolved"]
TYPE_PREFIX = "metaros.alert."
SUBJECT_CHARS = 200
_WORDS = {"opened": "", "acknowledged": "acknowledged: ", "resolved": "resolved: "}
_TIMES = ("opened", "first", "resolved", "acknowledged")


@dataclass(frozen=True, slots=True)
class Notice:
    """That an alert came to a stage, for one route; `number` tells repetitions apart."""

    alert: Alert
    stage: Stage
    number: int = 0


def cloud_event(notice: Notice, *, now_ns: int, link: str = "") -> dict[str, Any]:
    """The notice's document. A receiver that gets one `id` twice has been told the same twice."""
    alert = notice.alert
    document = {
        "specversion": "1.0",
        "id": f"{alert.id}.{notice.stage}.{alert.times}.{alert.severity}.{notice.number}",
        "source": f"/api/v1/robots/{alert.robot}" if alert.robot else "/api/v1",
        "type": TYPE_PREFIX + notice.stage,
        "time": moment(now_ns),
        "datacontenttype": "application/json",
        "gateway": alert.gateway,
        "data": _data(alert, link),
    }
    if alert.robot:
        document["subject"] = alert.robot
    return document


def test_event(route: Route, *, by: str, now_ns: int, gateway: str) -> dict[str, Any]:
    """A document that says only that the route works."""
    return {
        "specversion": "1.0",
        "id": f"test.{now_ns}",
        "source": "/api/v1",
        "type": "metaros.alert.test",
        "time": moment(now_ns),
        "datacontenttype": "application/json",
        "gateway": gateway,
        "data": {"route": route.name, "by": by, "message": "This is a test: nothing is wrong."},
    }


def event_bytes(document: dict[str, Any]) -> bytes:
    """The document as it is sent."""
    return orjson.dumps(document)


def mail_bytes(mailbox: Mailbox, notices: Sequence[Notice], *, now_ns: int, link: str = "", test: str = "") -> bytes:
    """A mail about some alerts, or with `test` about none: headers and body, lines ending in CR LF."""
    mail = EmailMessage(policy=SMTP.clone(cte_type="7bit"))
    mail["From"] = mailbox.sender
    mail["To"] = ", ".join(mailbox.to)
    mail["Subject"] = _line(f"[Meta-ROS] {_subject(notices) if notices else 'test'}")[:SUBJECT_CHARS]
    mail["Date"] = _date(now_ns)
    mail["Message-ID"] = f"<{notices[0].alert.id if notices else 'test'}.{now_ns}@{mailbox.sender.partition('@')[2]}>"
    mail["Auto-Submitted"] = "auto-generated"
    mail.set_content("\n\n".join(_paragraph(notice, link) for notice in notices) or test, cte="quoted-printable")
    return mail.as_bytes()


def _data(alert: Alert, link: str) -> dict[str, Any]:
    times = {name: getattr(alert, f"{name}_ns") for name in _TIMES}
    return {
        "alert": alert.id,
        "robot": alert.robot,
        "cause": alert.cause,
        "state": alert.state,
        "severity": alert.severity,
        "title": alert.title,
        "reason": alert.reason,
        "series": alert.series,
        "detector": alert.detector,
        "score": alert.score if math.isfinite(alert.score) else None,
        "value": alert.value,
        "low": alert.low,
        "high": alert.high,
        **{name: moment(at_ns) if at_ns else None for name, at_ns in times.items()},
        "acknowledged_by": alert.acknowledged_by,
        "resolved_by": alert.resolved_by,
        "assignee": alert.assignee,
        "times": alert.times,
        "findings": len(alert.findings),
        "clip": alert.clip,
        "path": alert_path(alert),
        "url": link.rstrip("/") + alert_path(alert) if link else None,
    }


def _subject(notices: Sequence[Notice]) -> str:
    first = notices[0]
    more = f" and {len(notices) - 1} more" if len(notices) > 1 else ""
    return f"{_WORDS[first.stage]}{first.alert.severity}: {first.alert.robot or 'fleet'}: {first.alert.title}{more}"


def _paragraph(notice: Notice, link: str) -> str:
    alert = notice.alert
    lines = [f"{_WORDS[notice.stage]}{alert.severity}: {alert.robot or 'the fleet'}: {alert.title}"]
    lines += [_line(alert.reason)] if alert.reason else []
    lines.append(f"since {moment(alert.opened_ns)}" + (f", began {alert.times} times" if alert.times > 1 else ""))
    if notice.stage == "acknowledged":
        lines.append(f"acknowledged by {_line(alert.acknowledged_by)}")
    if notice.stage == "resolved":
        lines.append(f"resolved {moment(alert.resolved_ns)} by {_line(alert.resolved_by) or 'itself'}")
    lines += [link.rstrip("/") + alert_path(alert)] if link else []
    return "\n".join(lines)


def _line(text: str) -> str:
    """Words on one line, whatever was in them."""
    return "".join(char if char.isprintable() else " " for char in text)


def _date(now_ns: int) -> str:
    from email.utils import formatdate

    return formatdate(now_ns / 1e9)
