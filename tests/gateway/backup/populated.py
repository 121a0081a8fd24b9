"""A gateway on which a lot has happened, and a hundred questions about it whose answers do not depend on the hour."""

from __future__ import annotations

import asyncio
import io
import zipfile
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import boto3
import httpx
import orjson
from botocore.config import Config

from gateway.domain.principal import Role
from gateway.main import Ready
from tests.gateway.harness import client
from tests.support.gateways.busy_gateway import BusyGateway, busy_gateway

__all__ = ["ROBOTS", "VOLATILE", "answers", "populate", "questions"]

ROBOTS = ("arm_1", "cart_1", "cart_2")
RULE = {
    "name": "robots-fail",
    "description": "who fails is put down",
    "pattern": {"detail-type": ["order.failed"]},
    "when": {"cooldown": "1m"},
    "targets": [{"id": "note", "kind": "alert", "severity": "info", "reason": "an order failed"}],
}
SCHEDULE = {
    "name": "new-year",
    "schedule": {"expression": "cron(0 0 1 1 ? 2099)", "timezone": "UTC"},
    "targets": [{"id": "note", "kind": "alert", "severity": "info", "reason": "a new year"}],
}
# Of the process that answers, of now, or of rows that a start and a restore themselves write.
VOLATILE = frozenset(
    {
        "checked",  # when the store was looked at
        "days_until_bound",
        "days_until_full",
        "disk_free_bytes",
        "growth_bytes_per_day",
        "tables",  # of the store's account: the restore is a row of the audit log
        "total_bytes",
    }
)
VOLATILE_AT = {
    "/api/v1/alerts": {"gateway", "revision"},  # a new data directory is a new gateway, which takes them over
    "/api/v1/store": {"objects"},  # the restore is a row of the audit log, whose head is exported when it is
}


async def populate(folder: Path, **settings: Any) -> str:
    """Let it happen; the gateway has ended afterwards. What is returned: the span in which it did, as a query."""
    begun = datetime.now(UTC) - timedelta(minutes=5)
    async with busy_gateway(folder, *ROBOTS, **settings) as made:
        async with client(made.ready, key=made.admin) as http:
            await _configure(http)
            await _people(http)
            await _alerts(made, http)
            for robot in ROBOTS:
                order = {
                    "kind": "call_service",
                    "request": {"service": f"/{robot}/dock", "type": "std_srvs/srv/Trigger"},
                }
                assert (await http.post(f"/api/v1/robots/{robot}/commands?wait_s=5", json=order)).is_success
            entries = [{"id": f"o{n}", "type": "order.failed", "detail": {"n": n}} for n in range(5)]
            assert (await http.post("/api/v1/happenings", json={"entries": entries})).status_code == 202
        await asyncio.to_thread(_functions, made.ready, await made.key(Role.ADMIN))
    ended = datetime.now(UTC) + timedelta(seconds=1)
    return f"start={begun:%Y-%m-%dT%H:%M:%SZ}&end={ended:%Y-%m-%dT%H:%M:%SZ}"


async def _configure(http: httpx.AsyncClient) -> None:
    for document in (RULE, SCHEDULE):
        answer = await http.put(f"/api/v1/rules/{document['name']}", json=document)
        assert answer.status_code in (200, 201), answer.text
    template = {"selector": "site=lab", "document": {"parameters": {}}, "priority": 1}
    assert (await http.put("/api/v1/templates/lab", json=template)).is_success
    for robot in ROBOTS:
        labels = {"labels": {"site": "lab", "line": robot[-1]}}
        assert (await http.patch(f"/api/v1/robots/{robot}/labels", json=labels)).is_success


async def _people(http: httpx.AsyncClient) -> None:
    for name, role in (("ada", "operator"), ("bob", "viewer")):
        assert (await http.post("/api/v1/users", json={"name": name, "role": role})).status_code == 201
    assert (await http.post("/api/v1/enrolment-tokens", json={"robot": "", "ttl_s": 3600})).status_code == 201
    hook = {"name": "git", "description": "pushes", "auth": "bearer"}
    assert (await http.post("/api/v1/hooks", json=hook)).status_code == 201


async def _alerts(made: BusyGateway, http: httpx.AsyncClient) -> None:
    alert = made.alerts[ROBOTS[0]]
    assert (await http.post(f"/api/v1/alerts/{alert}/acknowledge", json={"text": "I look"})).is_success
    for alert in made.alerts.values():  # an open one goes on by the clock, and with the gateway that watches it
        assert (await http.post(f"/api/v1/alerts/{alert}/resolve", json={"text": "cooled"})).is_success
    silence = {"robots": [ROBOTS[1]], "for_s": 86400 * 7, "reason": "in the workshop"}
    assert (await http.post("/api/v1/silences", json=silence)).status_code == 201


def _functions(ready: Ready, key: str) -> None:
    """A function with a version and an alias."""
    with httpx.Client(base_url=ready.url, trust_env=False, timeout=60) as http:
        body = {"name": "lambda", "role": "admin", "scopes": ["lambda"]}
        local = (ready.data_dir / "local.key").read_text().strip()
        made = http.post("/api/v1/keys", json=body, headers={"Authorization": f"Bearer {local}"}).json()["key"]
    key_id, secret = made.removeprefix("mrk_").split("_")
    code = io.BytesIO()
    with zipfile.ZipFile(code, "w") as archive:
        archive.writestr("app.py", "def handler(event, context):\n    return event\n")
    functions: Any = boto3.client(
        "lambda",
        endpoint_url=f"{ready.url}/lambda",
        region_name="us-east-1",
        aws_access_key_id=key_id,
        aws_secret_access_key=secret,
        config=Config(retries={"total_max_attempts": 1}, read_timeout=60, proxies={}),
    )
    functions.create_function(
        FunctionName="echo",
        Runtime="python3.11",
        Role="arn:aws:iam::000000000000:role/x",
        Handler="app.handler",
        Code={"ZipFile": code.getvalue()},
    )
    functions.publish_version(FunctionName="echo")
    functions.create_alias(FunctionName="echo", Name="live", FunctionVersion="1")


def questions(recordings: list[str], alerts: list[str], span: str) -> list[str]:
    """A hundred paths; `span` is what `populate` said."""
    return [
        *_of_the_fleet(span),
        *(path for robot in ROBOTS for path in _of_a_robot(robot, span)),
        *(f"/api/v1/recordings/{one}{file}" for one in recordings for file in ("", "/file.mcap")),
        *(f"/api/v1/alerts/{one}" for one in alerts),
    ]


def _of_the_fleet(span: str) -> Iterator[str]:
    yield from (f"/api/v1/robots{more}" for more in ("", "?fields=id,labels", "?selector=line%3D2", "?q=cart"))
    yield from (f"/api/v1/{path}" for path in ("groups?label=site", "users", "users/ada", "users/bob"))
    yield from (f"/api/v1/{path}" for path in ("keys", "enrol/roots", "identities", "alerts", "alerts/counts"))
    yield from (f"/api/v1/{path}" for path in ("silences", "alert-checks", "alert-routes", "rules", "rules?q=fail"))
    yield from (f"/api/v1/rules/{name}{more}" for name in ("robots-fail", "new-year") for more in ("", "/history"))
    yield from (f"/api/v1/{path}" for path in ("schedules", "hooks", f"happenings?{span}", "functions/echo"))
    yield from (f"/api/v1/functions/echo/code{more}" for more in ("", "?version=1", "/text?path=app.py"))
    yield from (f"/api/v1/{path}" for path in ("functions/echo/invocations", "replays", "dead-letters", "commands"))
    yield from (f"/api/v1/{path}" for path in ("recordings", "twins", "templates", "templates/lab", "updates"))
    yield from (f"/api/v1/{path}" for path in ("templates/lab/history", "rollouts", "twin/schema", "store"))
    yield from (
        f"/api/v1/{path}" for path in ("store/retention", "audit?limit=20&before=25", "events?after=0&limit=40")
    )
    yield f"/api/v1/export.mcap?robot={ROBOTS[0]}&robot={ROBOTS[1]}&topic=chatter&{span}"


def _of_a_robot(robot: str, span: str) -> Iterator[str]:
    root, until = f"/api/v1/robots/{robot}", span.partition("&end=")[2]
    yield root
    yield from (f"{root}/{path}" for path in ("gaps", "history", f"timeline?{span}&buckets=20", "twin", "twin/history"))
    for name in ("battery.x", "motors.left_motor.temperature"):
        yield f"{root}/metrics/range?name={name}&{span}&points=50"
    yield from (f"{root}/messages?topic=chatter&{span}&limit=10&order={order}" for order in ("asc", "desc"))
    yield from (f"{root}/at?t={until}&topic=chatter&max_age=1h&format={form}" for form in ("json", "records"))
    yield from (f"/api/v1/{noun}?robot={robot}" for noun in ("alerts", "recordings", "commands"))


async def answers(ready: Ready, paths: list[str]) -> dict[str, tuple[int, bytes]]:
    """Status and body of each; of JSON without what is volatile."""
    admin = (ready.data_dir / "local.key").read_text().strip()
    found = {}
    async with client(ready, key=admin) as http:
        for path in paths:
            answer = await http.get(path)
            body = answer.content
            if answer.headers.get("content-type", "").startswith("application/json"):
                volatile = VOLATILE.union(*(names for start, names in VOLATILE_AT.items() if path.startswith(start)))
                body = orjson.dumps(_steady(answer.json(), volatile), option=orjson.OPT_SORT_KEYS)
            found[path] = (answer.status_code, body)
    return found


def _steady(value: Any, volatile: frozenset[str]) -> Any:
    if isinstance(value, dict):
        return {key: _steady(item, volatile) for key, item in value.items() if key not in volatile}
    return [_steady(item, volatile) for item in value] if isinstance(value, list) else value
