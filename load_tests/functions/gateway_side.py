"""A real gateway in a process of its own with one function, and its endpoints: our REST and AWS's API through boto3."""

from __future__ import annotations

import base64
import io
import time
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import boto3
import httpx
from botocore.auth import SigV4Auth
from botocore.awsrequest import AWSRequest
from botocore.config import Config
from botocore.credentials import Credentials

from load_tests.functions.clients import Endpoint
from load_tests.functions.figures import Calls
from tests.support.processes.stack import Stack

__all__ = ["HANDLER", "NAME", "Functions", "running_gateway"]

NAME = "bench"
HANDLER = "def handler(event, context):\n    return event\n"
FREE = ("--requests-per-s", "0", "--robot-requests-per-s", "0")


@dataclass(frozen=True, slots=True)
class Functions:
    """The gateway's endpoints."""

    stack: Stack
    lambda_client: Any
    credentials: Credentials

    def endpoint(self, kind: str) -> Endpoint:
        """Our REST: `kind` request waits for the result, event has it durable."""
        headers = {"Authorization": f"Bearer {self.stack.key}"}
        good = 202 if kind == "event" else 200
        return Endpoint(self.stack.http_port, f"/api/v1/functions/{NAME}/invoke?kind={kind}", headers, good)

    def invoke(self) -> Endpoint:
        """The Lambda API's Invoke, which is what the emulator serves, too. It is signed here once, and good for five
        minutes; the gateway checks the signature of every call.
        """
        path = f"/lambda/2015-03-31/functions/{NAME}/invocations"
        headers = {"Content-Type": "application/json"}
        request = AWSRequest("POST", f"{self.stack.url}{path}", headers=headers, data=b'{"n":1}')
        SigV4Auth(self.credentials, "lambda", "local").add_auth(request)
        return Endpoint(self.stack.http_port, path, dict(request.headers.items()))

    def call_with_boto3(self, count: int) -> Calls:
        """Invoke, request and response, signed as AWS has it."""
        took, failed, began = [], 0, time.perf_counter()
        for _ in range(count):
            start = time.perf_counter()
            answer = self.lambda_client.invoke(FunctionName=NAME, Payload=b'{"n":1}')
            answer["Payload"].read()
            if answer["StatusCode"] == 200 and "FunctionError" not in answer:
                took.append((time.perf_counter() - start) * 1000)
            else:
                failed += 1
        return Calls(tuple(took), failed, time.perf_counter() - began)


@contextmanager
def running_gateway(folder: Path, *, options: tuple[str, ...] = ()) -> Iterator[Functions]:
    """It has the function, and a key for boto3."""
    with Stack(folder) as stack:
        ports = ("--port", str(stack.http_port), "--grpc-port", str(stack.grpc_port))
        stack.start("gateway", "gateway", *ports, "--data-dir", str(folder / "data"), *FREE, *options)
        with httpx.Client(base_url=stack.url, trust_env=False, timeout=60) as http:
            http.headers["Authorization"] = f"Bearer {stack.key}"
            body = {"zip": base64.b64encode(_zipped()).decode(), "handler": "app.handler", "timeout_s": 30}
            http.put(f"/api/v1/functions/{NAME}", json=body).raise_for_status()
            asked = {"name": "bench", "role": "admin", "scopes": ["lambda"]}
            key_id, secret = (
                http.post("/api/v1/keys", json=asked).raise_for_status().json()["key"].removeprefix("mrk_").split("_")
            )
        client = boto3.client(
            "lambda",
            endpoint_url=f"{stack.url}/lambda",
            region_name="local",
            aws_access_key_id=key_id,
            aws_secret_access_key=secret,
            config=Config(retries={"total_max_attempts": 1}, proxies={}),
        )
        yield Functions(stack, client, Credentials(key_id, secret))


def _zipped() -> bytes:
    target = io.BytesIO()
    with zipfile.ZipFile(target, "w") as archive:
        archive.writestr("app.py", HANDLER)
    return target.getvalue()
