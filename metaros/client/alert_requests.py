"""REST requests about alerts, as values; see `metaros.client.requests`."""

from __future__ import annotations

import json
import uuid
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar
from urllib.parse import quote

from metaros._proto import alerts_pb2
from metaros.client.alert_results import Alert
from metaros.client.requests import RestRequest, get, robot_path
from metaros.client.rpc import patterns
from metaros.limits import LIMITS

__all__ = [
    "action",
    "add_silence",
    "alert",
    "alerts",
    "backtest",
    "band",
    "check",
    "checks",
    "clip",
    "end_silence",
    "learning",
    "normal",
    "reset_check",
    "silence",
    "silences",
    "watch_request",
]

T = TypeVar("T")
Names = str | Sequence[str]
PATH = "/api/v1/alerts"
MOST = 1000
SLACK_S = 60.0


def alerts(
    *,
    states: Names | None,
    severities: Names | None,
    robots: Names | None,
    causes: Names | None,
    text: str,
    start: str,
    end: str,
    quiet: bool | None,
    limit: int,
    before: Any,
) -> RestRequest[tuple[list[Alert], Any]]:
    """A page of alerts, and where the next one begins; None: nowhere."""
    query = {
        "state": patterns(states) or None,
        "severity": patterns(severities) or None,
        "robot": patterns(robots) or None,
        "cause": patterns(causes) or None,
        "q": text or None,
        "from": start or None,
        "until": end or None,
        "quiet": None if quiet is None else str(quiet).lower(),
        "limit": min(limit, MOST),
        "before": before,
    }

    def read(answer: Any) -> tuple[list[Alert], Any]:
        return [Alert.of(item) for item in answer["alerts"]], answer.get("next")

    return get(PATH, read, **query)


def alert(alert_id: str) -> RestRequest[Alert]:
    """One, with its findings and remarks."""
    return get(_path(alert_id), Alert.of)


def action(alert_id: str, verb: str, body: Mapping[str, Any], *, idempotent: bool = True) -> RestRequest[Alert]:
    """What somebody does with one. Doing it again changes nothing, but for a comment, which carries a key for that."""
    return _post(_path(alert_id, f"/{verb}"), body, Alert.of, once=not idempotent)


def normal(alert_id: str, text: str) -> RestRequest[list[str]]:
    """What was taught."""
    return _post(_path(alert_id, "/normal"), {"text": text}, lambda answer: list(answer["taught"]))


def silence(alert_id: str, *, for_s: float, reason: str) -> RestRequest[Any]:
    """A silence of an alert's cause on its robot."""
    return _post(_path(alert_id, "/silence"), {"for_s": for_s, "reason": reason}, _itself, once=True)


def clip(alert_id: str) -> RestRequest[str]:
    """The id of the recording of its evidence."""
    return _post(_path(alert_id, "/clip"), {}, lambda answer: str(answer["id"]))


def silences() -> RestRequest[list[Any]]:
    """Those that are not over."""
    return get("/api/v1/silences", lambda answer: list(answer["silences"]), limit=MOST)


def add_silence(
    *, robots: Names | None, causes: Names | None, up_to: str, for_s: float, reason: str
) -> RestRequest[Any]:
    """A silence of whatever matches."""
    body = {"robots": patterns(robots), "causes": patterns(causes), "up_to": up_to, "for_s": for_s, "reason": reason}
    return _post("/api/v1/silences", body, _itself, once=True)


def end_silence(silence_id: str) -> RestRequest[Any]:
    """No longer silent."""
    return RestRequest(method="DELETE", path=f"/api/v1/silences/{quote(silence_id, safe='')}", read=_itself)


def checks() -> RestRequest[list[Any]]:
    """The table of checks."""
    return get("/api/v1/alert-checks", lambda answer: list(answer["checks"]), limit=MOST)


def check(check_id: str, changes: Mapping[str, Any]) -> RestRequest[Any]:
    """Change a check."""
    content = json.dumps(dict(changes)).encode()
    return RestRequest(method="PUT", path=_check_path(check_id), read=_itself, content=content, idempotent=True)


def reset_check(check_id: str) -> RestRequest[Any]:
    """Put a check back."""
    return RestRequest(method="DELETE", path=_check_path(check_id), read=_itself, idempotent=True)


def learning(robot: str) -> RestRequest[list[Any]]:
    """What is learned of each series."""
    return get(robot_path(robot, "/watch"), lambda answer: list(answer["series"]), limit=MOST)


def band(robot: str, series: str, *, start: str, end: str) -> RestRequest[list[Any]]:
    """Points of a series with what was expected."""
    query = {"series": series, "from": start, "to": end}
    return get(robot_path(robot, "/watch/band"), lambda answer: list(answer["points"]), **query)


def backtest(
    robot: str,
    *,
    series: Names | None,
    start: str,
    end: str,
    checks: Mapping[str, Mapping[str, Any]] | None,
    only: Names | None,
) -> RestRequest[Any]:
    """What would have fired."""
    changes = {name: dict(change) for name, change in (checks or {}).items()}
    wanted = {"robot": robot, "series": patterns(series), "from": start, "to": end}
    body = json.dumps({**wanted, "checks": changes, "detectors": patterns(only)}).encode()
    return RestRequest(
        method="POST", path="/api/v1/backtests", read=_itself, content=body, timeout_s=LIMITS.backtest_s + SLACK_S
    )


def watch_request(
    robots: Names | None, causes: Names | None, severities: Names | None
) -> alerts_pb2.WatchAlertsRequest:
    """What WatchAlerts is asked."""
    wanted = alerts_pb2.AlertFilter(robots=patterns(robots), causes=patterns(causes), severities=patterns(severities))
    return alerts_pb2.WatchAlertsRequest(filter=wanted)


def _post(path: str, body: Mapping[str, Any], read: Callable[[Any], T], *, once: bool = False) -> RestRequest[T]:
    """With `once` it carries a key by which the gateway knows it again."""
    headers = {"idempotency-key": uuid.uuid4().hex} if once else {}
    content = json.dumps(dict(body)).encode()
    return RestRequest(method="POST", path=path, read=read, content=content, headers=headers, idempotent=True)


def _check_path(check_id: str) -> str:
    return f"/api/v1/alert-checks/{quote(check_id, safe='')}"


def _path(alert_id: str, rest: str = "") -> str:
    return f"{PATH}/{quote(alert_id, safe='')}{rest}"


def _itself(answer: Any) -> Any:
    return answer
