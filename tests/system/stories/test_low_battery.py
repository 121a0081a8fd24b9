"""The story of a rule, by the real programs: a battery runs low, a function decides, and the robot drives to its dock.

The gateway is killed as soon as the function's call was accepted or made: what was promised is kept all the same.
"""

from __future__ import annotations

import base64
import io
import json
import urllib.error
import urllib.request
import zipfile
from pathlib import Path
from typing import Any

import boto3
import pytest

from tests.support.processes.stack import Stack
from tests.support.waiting import wait_until

ROBOT = "sim_1"
STEP_S = 150.0  # of the story, on a busy machine
BUS = "arn:aws:events:local:000000000000:event-bus/default"
HANDLER = """
import time

def handler(event, context):
    time.sleep(1.0)  # so that somebody can pull the plug meanwhile
    detail = event["detail"]
    if detail["value"] > 0.5:
        return {"dock": False}
    return {"dock": True, "robot": detail["robot"], "charge": detail["value"]}
"""
LOW = {
    "name": "battery_low",
    "description": "a battery runs low",
    "metric": {"series": "battery_state.percentage", "below": 0.5},
    "targets": [{"id": "decide", "kind": "function", "function": "decide"}],
}
DOCK = {
    "name": "dock",
    "description": "a function says that a robot shall dock",
    "pattern": {
        "detail-type": ["Lambda Function Invocation Result - Success"],
        "detail": {"responsePayload": {"dock": [True]}},
    },
    "targets": [
        {
            "id": "dock",
            "kind": "command",
            "command": "call_service",
            "robot": ROBOT,
            "input": {"service": f"/{ROBOT}/base/dock", "type": "std_srvs/srv/Trigger"},
        }
    ],
}


def ask(stack: Stack, method: str, path: str, body: Any = None) -> Any:
    """One request of the API, as an administrator of this machine."""
    request = urllib.request.Request(stack.url + path, method=method)
    request.add_header("Authorization", f"Bearer {stack.key}")
    data = None
    if body is not None:
        request.add_header("Content-Type", "application/json")
        data = json.dumps(body).encode()
    try:
        with urllib.request.urlopen(request, data, timeout=60) as answer:
            return json.load(answer)
    except urllib.error.HTTPError as error:
        raise AssertionError(f"{method} {path}: {error.code} {error.read().decode()}") from None


def commands(stack: Stack) -> list[dict[str, Any]]:
    """Calls of the dock that came to their end."""
    found = ask(stack, "GET", f"/api/v1/commands?robot={ROBOT}")["commands"]
    return [item for item in found if "/dock" in json.dumps(item["request"]) and item["state"] == "done"]


def code() -> str:
    """The function's zip file."""
    target = io.BytesIO()
    with zipfile.ZipFile(target, "w") as archive:
        archive.writestr("app.py", HANDLER)
    return base64.b64encode(target.getvalue()).decode()


def drain(stack: Stack) -> None:
    """The simulator's parameter: a tenth a second."""
    value = {"name": "battery_drain", "value": {"type": 3, "double_value": 0.1}}
    request = {"service": f"/{ROBOT}/base/set_parameters", "type": "rcl_interfaces/srv/SetParameters"}
    asked = {"kind": "call_service", "request": {**request, "request": {"parameters": [value]}}}
    done = ask(stack, "POST", f"/api/v1/robots/{ROBOT}/commands", asked)
    assert done["state"] == "done", done


def tell_the_bus(stack: Stack, function: str) -> None:
    """What the function returns becomes an event; said as everybody says it to AWS."""
    made = ask(stack, "POST", "/api/v1/keys", {"name": "story", "role": "admin", "scopes": ["lambda"]})
    key_id, secret = made["key"].removeprefix("mrk_").split("_")
    client = boto3.client(
        "lambda",
        endpoint_url=f"{stack.url}/lambda",
        region_name="local",
        aws_access_key_id=key_id,
        aws_secret_access_key=secret,
    )
    destinations = {"OnSuccess": {"Destination": BUS}}
    client.put_function_event_invoke_config(FunctionName=function, DestinationConfig=destinations)


@pytest.mark.integration
@pytest.mark.timeout(900)
def test_a_low_battery_sends_the_robot_to_its_dock(tmp_path: Path) -> None:
    with Stack(tmp_path) as stack:
        stack.router()
        gateway, *_ = stack.at_once(stack.gateway, lambda: stack.sim("--no-camera"), lambda: stack.agent(ROBOT))
        wait_until(lambda: stack.online() == {ROBOT}, timeout_s=60)
        ask(stack, "PUT", "/api/v1/functions/decide", {"zip": code(), "handler": "app.handler", "timeout_s": 30})
        tell_the_bus(stack, "decide")
        ask(stack, "PUT", "/api/v1/rules/battery_low", LOW)
        ask(stack, "PUT", "/api/v1/rules/dock", DOCK)

        drain(stack)
        wait_until(lambda: fired(stack, "battery_low") >= 1, timeout_s=STEP_S, every_s=0.2)
        gateway.kill()
        stack.gateway()

        wait_until(lambda: len(commands(stack)) >= 1, timeout_s=STEP_S, every_s=0.5)
        (command,) = commands(stack)
        assert "charging pad" in json.dumps(command["result"])
        assert ask(stack, "GET", "/api/v1/dead-letters")["dead_letters"] == []


def fired(stack: Stack, rule: str) -> int:
    """How often a rule has set something off."""
    return int(ask(stack, "GET", f"/api/v1/rules/{rule}")["stats"]["fired"])
