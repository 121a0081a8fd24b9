"""A gateway that is killed with events under way: its next life calls the functions again, and loses none."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx
import pytest

from gateway.identity.local_key import LOCAL_KEY_FILE
from tests.support.gateways.lambda_gateway import ROLE, lambda_gateway, zipped
from tests.support.processes.processes import END_S, end
from tests.support.waiting import wait_until

CODE = """
import time
def handler(event, context):
    time.sleep(event["s"])
    return event
"""
EVENTS = 3

pytestmark = pytest.mark.integration


@contextmanager
def gateway(folder: Path) -> Iterator[tuple[subprocess.Popen[bytes], str]]:
    """A gateway as a program, and its address."""
    status = folder / "status.json"
    status.unlink(missing_ok=True)
    ports = [flag for name in ("port", "grpc-port", "api-grpc-port") for flag in (f"--{name}", "0")]
    off = ["--foxglove-port", "off", "--rosbridge-port", "off"]
    argv = [sys.executable, "-m", "metaros", "gateway", "--data-dir", str(folder / "data"), *ports, *off]
    environment = {**os.environ, "HOME": str(folder)}
    process = subprocess.Popen([*argv, "--status-file", str(status)], stdout=subprocess.DEVNULL, env=environment)
    try:
        wait_until(lambda: status.exists() or process.poll() is not None)
        yield process, str(json.loads(status.read_text())["url"])
    finally:
        end(process)


def http_of(folder: Path, url: str) -> httpx.Client:
    """An administrator's client."""
    local = (folder / "data" / LOCAL_KEY_FILE).read_text().strip()
    return httpx.Client(base_url=url, headers={"Authorization": f"Bearer {local}"}, trust_env=False, timeout=END_S)


def lambda_of(http: httpx.Client, url: str) -> Any:
    """A boto3 client, with a new key."""
    import boto3  # heavy
    from botocore.config import Config

    made = http.post("/api/v1/keys", json={"name": "crash", "role": "admin", "scopes": ["lambda"]})
    key_id, secret = made.json()["key"].removeprefix("mrk_").split("_")
    return boto3.client(
        "lambda",
        endpoint_url=f"{url}/lambda",
        region_name="local",
        aws_access_key_id=key_id,
        aws_secret_access_key=secret,
        config=Config(retries={"total_max_attempts": 1}, proxies={}),
    )


def test_events_survive_a_kill(tmp_path: Path) -> None:
    with gateway(tmp_path) as (process, url), http_of(tmp_path, url) as http:
        client = lambda_of(http, url)
        code = {"ZipFile": zipped(CODE)}
        options: dict[str, Any] = {"Runtime": "python3.11", "Handler": "app.handler", "Role": ROLE, "Timeout": 30}
        client.create_function(FunctionName="slow", Code=code, **options)
        client.get_waiter("function_active_v2").wait(FunctionName="slow")
        asked = {
            client.invoke(FunctionName="slow", InvocationType="Event", Payload=json.dumps({"s": 0.7, "n": number}))[
                "ResponseMetadata"
            ]["RequestId"]
            for number in range(EVENTS)
        }
        wait_until(
            lambda: any(pool["busy"] for pool in http.get("/api/v1/functions-runtime").json()["pools"]), every_s=0.05
        )
        workers = children_of(process.pid)
        process.send_signal(signal.SIGKILL)
        process.wait(END_S)
    assert workers
    wait_until(lambda: not any(Path(f"/proc/{worker}").exists() for worker in workers))
    with lambda_gateway(tmp_path) as again, http_of(tmp_path, again.ready.url) as http:

        def done() -> set[str]:
            found = http.get("/api/v1/functions/slow/invocations", params={"status": "ok"}).json()["invocations"]
            return {item["request_id"] for item in found}

        wait_until(lambda: done() >= asked, every_s=0.05)
        stats = http.get("/api/v1/functions/slow").json()["stats"]
        assert (stats["waiting"], stats["dead_letters"]) == (0, 0)


def children_of(pid: int) -> list[int]:
    """The processes below one, as far down as there are."""
    found: list[int] = []
    waiting = [pid]
    while waiting:
        for task in Path(f"/proc/{waiting.pop()}/task").glob("*/children"):
            below = [int(word) for word in task.read_text().split()]
            found += below
            waiting += below
    return found
