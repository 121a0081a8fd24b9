"""What the examples of the API's document say of alerts: a motor of sim_1 ran hot at noon."""

from __future__ import annotations

from typing import Any

__all__ = ["ALERT_OPERATIONS"]

NOON, THEN, LATER = "2026-05-04T12:00:00.000Z", "2026-05-04T12:00:05.000Z", "2026-05-04T13:00:05.000Z"
ULID, CLIP = "01JTCQ5Z8K3W9V2N6R4X7Y0B1C", "01JTCQ64C0T5G8H2J9K3M6N7PQ"
SERIES = "motors.left_motor.temperature"
REASON = "97.3 °C is above 95 °C for 2 s"
STAMP_MS = 1_777_896_000_000.0

_FOUND = {"severity": "error", "score": 0.93, "value": 97.3, "low": None, "high": 95.0, "reason": REASON}
_FINDING = {"detector": "motor_overheats", "series": SERIES, **_FOUND}
_ALERT: dict[str, Any] = {
    "id": ULID,
    "robot": "sim_1",
    "cause": "heat",
    "state": "open",
    "title": "Motor overheats",
    **_FINDING,
    "opened": THEN,
    "first": NOON,
    "changed": THEN,
    "seen": THEN,
    "clearing": None,
    "resolved": None,
    "resolved_by": "",
    "acknowledged": None,
    "acknowledged_by": "",
    "assignee": "",
    "times": 1,
    "clip": CLIP,
    "inhibited_by": "",
    "silence": "",
    "quiet": False,
    "gateway": "3f2a9c",
    "revision": 2,
    "path": f"/robots/sim_1?t={NOON}&span=15m",
}
_SEEN_TO = {**_ALERT, "state": "acknowledged", "acknowledged": LATER, "acknowledged_by": "ada", "revision": 3}
_RESOLVED = {**_SEEN_TO, "state": "resolved", "resolved": LATER, "resolved_by": "ada"}
_REMARK = {"number": 1, "at": LATER, "by": "ada", "kind": "comment", "text": "The brake drags."}
_DETAIL = {**_ALERT, "findings": [{**_FINDING, "at": NOON, "active": True}], "remarks": [_REMARK]}
_TEXT = {"text": "The brake drags."}
_SILENCE = {
    "id": ULID,
    "robots": ["sim_1"],
    "causes": ["heat"],
    "up_to": "error",
    "from": THEN,
    "until": LATER,
    "by": "ada",
    "reason": "on the lift",
}
_CHECK = {
    "id": "motor_overheats",
    "title": "Motor overheats",
    "unit": "°C",
    "enabled": True,
    "low": None,
    "high": 95.0,
    "for_s": 2.0,
    "clear_s": 30.0,
    "severity": "error",
    "changed": [],
    "changed_by": "",
    "changed_at": None,
}
_CHANGED = {**_CHECK, "high": 90.0, "changed": ["high"], "changed_by": "ada", "changed_at": NOON}
_ROUTE = {
    "name": "workshop",
    "kind": "webhook",
    "target": "https://alerts.example/hook",
    "severity": "warning",
    "robots": ["sim_*"],
    "causes": [],
    "sent": 3,
    "failed": 0,
    "waiting": 0,
    "last": THEN,
    "last_error": "",
}
_POINTS = [[STAMP_MS - 1000, 61.0, 58.2, 63.9, 0.02], [STAMP_MS, 97.3, 58.2, 64.0, 0.93]]
_BACKTEST = {
    "robot": "sim_1",
    "span": {"from": "2026-05-04T11:00:00.000Z", "to": LATER},
    "samples": 72_000,
    "findings": [{**_FINDING, "cause": "heat", "at": NOON, "until": None}],
    "alerts": [
        {
            "cause": "heat",
            "severity": "error",
            "title": "Motor overheats",
            "reason": REASON,
            "first": NOON,
            "last": None,
            "findings": 1,
        }
    ],
    "series": [{"series": SERIES, "samples": 7200, "points": _POINTS}],
    "cut": False,
    "took_s": 1.8,
}

_BASE, _ONE = "/api/v1", "/api/v1/alerts/{alert_id}"
# By operation: its request, or its answer.
ALERT_OPERATIONS: dict[str, dict[str, Any]] = {
    f"GET {_BASE}/alerts": {"answer": {"alerts": [_ALERT], "next": ULID}},
    f"GET {_BASE}/alerts/counts": {
        "answer": {"open": 1, "acknowledged": 0, "error": 1, "warning": 0, "info": 0, "quiet": 2}
    },
    f"GET {_ONE}": {"answer": _DETAIL},
    f"POST {_ONE}/acknowledge": {"request": _TEXT, "answer": _SEEN_TO},
    f"POST {_ONE}/unacknowledge": {"request": _TEXT, "answer": _ALERT},
    f"POST {_ONE}/resolve": {"request": _TEXT, "answer": _RESOLVED},
    f"POST {_ONE}/comments": {"request": _TEXT, "answer": _DETAIL},
    f"POST {_ONE}/assign": {"request": {"assignee": "ada"}, "answer": {**_SEEN_TO, "assignee": "ada"}},
    f"POST {_ONE}/normal": {
        "request": {"text": "It is summer."},
        "answer": {"alert": _ALERT, "taught": [f"97.3 °C of {SERIES} is normal"]},
    },
    f"POST {_ONE}/silence": {"request": {"for_s": 3600.0, "reason": "on the lift"}, "answer": _SILENCE},
    f"GET {_BASE}/silences": {"answer": {"silences": [_SILENCE], "next": None}},
    f"POST {_BASE}/silences": {
        "request": {"robots": ["sim_1"], "causes": ["heat"], "for_s": 3600.0, "reason": "on the lift"},
        "answer": _SILENCE,
    },
    f"DELETE {_BASE}/silences/{{silence_id}}": {"answer": _SILENCE},
    f"GET {_BASE}/alert-checks": {"answer": {"checks": [_CHECK], "next": None}},
    f"PUT {_BASE}/alert-checks/{{check_id}}": {"request": {"high": 90.0}, "answer": _CHANGED},
    f"DELETE {_BASE}/alert-checks/{{check_id}}": {"answer": _CHECK},
    f"GET {_BASE}/alert-routes": {"answer": {"routes": [_ROUTE], "next": None}},
    f"POST {_BASE}/alert-routes/{{name}}/test": {"answer": {"ok": True, "status": 204, "error": "", "took_s": 0.12}},
    f"GET {_BASE}/robots/{{robot_id}}/watch": {
        "answer": {
            "series": [{"series": SERIES, "seen": 62, "of": 750, "score": 0.0, "low": 58.2, "high": 64.0}],
            "next": None,
        }
    },
    f"GET {_BASE}/robots/{{robot_id}}/watch/band": {"answer": {"robot": "sim_1", "series": SERIES, "points": _POINTS}},
    f"POST {_BASE}/backtests": {
        "request": {"robot": "sim_1", "from": "-24h", "checks": {"motor_overheats": {"high": 90.0}}},
        "answer": _BACKTEST,
    },
}
