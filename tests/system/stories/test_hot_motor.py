"""The story of an alert, by the real programs: a simulated motor heats up, somebody is told why, and ends it."""

from __future__ import annotations

import json
import urllib.request
from pathlib import Path
from typing import Any

import pytest
from mcap.writer import MCAP0_MAGIC

from tests.support.processes.stack import Stack
from tests.support.servers.webhook import Webhook
from tests.support.waiting import wait_until

ROBOT = "sim_1"
SERIES = "motor_temperature.temperature"
ABOVE_C = 4.0  # what the motor is now: a limit that it passes soon
STEP_S = 150.0  # of the story, on a busy machine


def ask(stack: Stack, method: str, path: str, body: Any = None) -> Any:
    """One request of the API, as an administrator of this machine."""
    request = urllib.request.Request(stack.url + path, method=method)
    request.add_header("Authorization", f"Bearer {stack.key}")
    data = None
    if body is not None:
        request.add_header("Content-Type", "application/json")
        data = json.dumps(body).encode()
    with urllib.request.urlopen(request, data, timeout=60) as answer:
        return json.load(answer)


def inject(stack: Stack, fault: str) -> None:
    """Tell the simulator, on the robot's fault topic."""
    message = {"topic": f"/{ROBOT}/base/fault", "type": "std_msgs/msg/String", "message": {"data": fault}}
    ask(stack, "POST", f"/api/v1/robots/{ROBOT}/publish", message)


def hot(stack: Stack, wanted: str) -> dict[str, Any] | None:
    """The alert about the motor's heat, once it is as wanted."""
    found = ask(stack, "GET", f"/api/v1/alerts?robot={ROBOT}&cause=heat&{wanted}")["alerts"]
    return dict(found[0]) if found else None


@pytest.mark.integration
def test_a_motor_heats_up_and_somebody_is_reported_why(tmp_path: Path) -> None:
    with Webhook() as hook, Stack(tmp_path) as stack:
        routes = tmp_path / "notify.toml"
        routes.write_text(f'wait_s = 0\n[[webhook]]\nname = "ops"\nurl = "{hook.url}"\nprivate = true\n')
        stack.router()
        stack.at_once(
            lambda: stack.gateway("--notify", str(routes)),
            lambda: stack.sim("--no-camera"),
            lambda: stack.agent(ROBOT),
        )
        wait_until(lambda: stack.online() == {ROBOT}, timeout_s=60)
        wait_until(lambda: learned(stack) >= 3, timeout_s=STEP_S, every_s=0.1)
        wait_until(lambda: band(stack), timeout_s=STEP_S, every_s=0.1)  # it is kept from when somebody first asked
        # A motor that is warm is the worst there is on this robot: nobody waits for 95 °C here.
        warm_c = round(band(stack)[-1][1] + ABOVE_C, 1)
        check = {"high": warm_c, "for_s": 1.0, "clear_s": 1.0, "severity": "error"}
        assert ask(stack, "PUT", "/api/v1/alert-checks/motor_hot", check)["changed"]
        assert hot(stack, "severity=error") is None

        inject(stack, "hot_motor")
        # It begins as a warning, as the heat rises fast, and becomes an error where the limit is passed.
        wait_until(lambda: hot(stack, "severity=error"), timeout_s=STEP_S, every_s=0.1)
        alert = hot(stack, "severity=error")
        assert alert is not None
        ask(stack, "POST", f"/api/v1/alerts/{alert['id']}/acknowledge", {"text": "I am on my way"})
        check_explained(stack, alert, warm_c)
        wait_until(lambda: clip_of(stack, alert["id"]) == "stored", timeout_s=STEP_S, every_s=0.1)
        check_clip(stack, alert)
        inject(stack, "clear")
        ask(stack, "POST", f"/api/v1/alerts/{alert['id']}/resolve", {"text": "a stone in the wheel"})  # it cools slowly
        over = ask(stack, "GET", f"/api/v1/alerts/{alert['id']}")
        assert over["state"] == "resolved"
        assert over["acknowledged_by"] == over["resolved_by"] != ""
        assert "I am on my way" in [remark["text"] for remark in over["remarks"]]
        reported = {"metaros.alert.opened", "metaros.alert.acknowledged", "metaros.alert.resolved"}
        wait_until(lambda: hook.kinds(alert["id"]) >= reported, timeout_s=STEP_S)


def learned(stack: Stack) -> int:
    """How many seconds of the motor's temperature the watch has seen."""
    rows = ask(stack, "GET", f"/api/v1/robots/{ROBOT}/watch")["series"]
    return max((int(row["seen"]) for row in rows if row["series"] == SERIES), default=0)


def band(stack: Stack) -> list[list[Any]]:
    """The motor's temperature as it was and was expected."""
    return list(ask(stack, "GET", f"/api/v1/robots/{ROBOT}/watch/band?series={SERIES}")["points"])


def check_explained(stack: Stack, alert: dict[str, Any], warm_c: float) -> None:
    """What, where, why, since when, and what was expected."""
    assert alert["severity"] == "error"
    assert alert["series"] == SERIES
    assert alert["value"] >= warm_c
    assert alert["high"] == warm_c
    assert f"{warm_c:g}" in alert["reason"]
    assert alert["path"].startswith(f"/robots/{ROBOT}?t=")
    stamps, values, lows, highs, _ = zip(*band(stack), strict=True)
    assert list(stamps) == sorted(stamps)
    assert max(values) >= warm_c - ABOVE_C / 2
    assert any(low is not None and high is not None and low < high for low, high in zip(lows, highs, strict=True))
    robot = ask(stack, "GET", f"/api/v1/robots/{ROBOT}")
    assert robot["alerts"]["error"] >= 1


def clip_of(stack: Stack, alert_id: str) -> str:
    """The state of the recording that is an alert's evidence."""
    clip = ask(stack, "GET", f"/api/v1/alerts/{alert_id}")["clip"]
    return str(ask(stack, "GET", f"/api/v1/recordings/{clip}")["state"]) if clip else ""


def check_clip(stack: Stack, alert: dict[str, Any]) -> None:
    """The black box's file is here, and is of the moment."""
    clip = ask(stack, "GET", f"/api/v1/alerts/{alert['id']}")["clip"]
    recording = ask(stack, "GET", f"/api/v1/recordings/{clip}")
    assert recording["messages"] > 0
    request = urllib.request.Request(f"{stack.url}/api/v1/recordings/{clip}/file.mcap")
    request.add_header("Authorization", f"Bearer {stack.key}")
    with urllib.request.urlopen(request, timeout=60) as answer:
        assert answer.read(8) == MCAP0_MAGIC
