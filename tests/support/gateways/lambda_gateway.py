"""A gateway on a thread of its own, with keys of the scope lambda and clients of AWS's own library for it."""

from __future__ import annotations

import asyncio
import io
import json
import threading
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import boto3
import httpx
from botocore.config import Config

from gateway.automation.functions.catalogue.shapes import faults_of
from gateway.identity.local_key import LOCAL_KEY_FILE
from gateway.main import Ready
from tests.gateway.harness import running_gateway
from tests.support.deployment.zips import member
from tests.support.gateways.plain_http import TRUSTS_NOBODY
from tests.support.gateways.quick_boto import read_documents_once

__all__ = ["HANDLER", "ROLE", "LambdaGateway", "lambda_gateway", "zipped"]

read_documents_once()
ROLE = "arn:aws:iam::000000000000:role/any"
ERRORS_OF_ALL = {  # that AWS has for every service, and botocore's model of this one does not list
    "AccessDeniedException",
    "IncompleteSignatureException",
    "InvalidSignatureException",
    "MissingAuthenticationTokenException",
    "UnknownOperationException",
    "UnrecognizedClientException",
}
HANDLER = "def handler(event, context):\n    return event\n"


def zipped(source: str = HANDLER, **files: str) -> bytes:
    """A zip file with `app.py`, and others by their names without the end."""
    target = io.BytesIO()
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in {"app": source, **files}.items():
            archive.writestr(member(f"{name}.py"), text)
    return target.getvalue()


@dataclass(frozen=True)
class LambdaGateway:
    """A running one; `folder` is its data directory."""

    ready: Ready
    folder: Path
    loop: asyncio.AbstractEventLoop

    @property
    def endpoint(self) -> str:
        """What boto3 is given."""
        return f"{self.ready.url}/lambda"

    def key(self, role: str = "admin", *, scopes: tuple[str, ...] = ("lambda",), **more: Any) -> tuple[str, str]:
        """A new key's id and secret."""
        local = (self.folder / LOCAL_KEY_FILE).read_text().strip()
        with httpx.Client(base_url=self.ready.url, trust_env=False, verify=TRUSTS_NOBODY, timeout=60) as http:
            body = {"name": f"{role} key", "role": role, "scopes": list(scopes), **more}
            answer = http.post("/api/v1/keys", json=body, headers={"Authorization": f"Bearer {local}"})
            assert answer.status_code == 201, answer.text
            key_id, secret = answer.json()["key"].removeprefix("mrk_").split("_")
            return key_id, secret

    def client(self, key: tuple[str, str] | None = None, *, region: str = "us-east-1", **config: Any) -> Any:
        """A boto3 client; of a new admin's key unless another is given."""
        key_id, secret = key or self.key()
        client: Any = boto3.client(
            "lambda",
            endpoint_url=self.endpoint,
            region_name=region,
            aws_access_key_id=key_id,
            aws_secret_access_key=secret,
            config=Config(retries={"total_max_attempts": 1}, read_timeout=60, proxies={}, **config),
        )
        client.meta.events.register("before-parse.lambda", check_answer)
        return client


def check_answer(operation_model: Any, response_dict: Any, **_more: Any) -> None:
    """Whether an answer, as it came, has what botocore's model says and nothing else; boto3 itself looks away."""
    status, headers, body = (response_dict[name] for name in ("status_code", "headers", "body"))
    if not isinstance(body, bytes):
        return  # a stream
    if status >= 300:
        name = headers["x-amzn-errortype"]
        shapes = {shape.name: shape for shape in operation_model.error_shapes}
        assert name in shapes or name in ERRORS_OF_ALL, f"{operation_model.name} has no error {name}"
        faults = list(faults_of(json.loads(body), shapes[name])) if name in shapes else []
    elif (shape := operation_model.output_shape) is None or shape.serialization.get("payload"):
        faults = []
    else:
        located = {name for name, member in shape.members.items() if member.serialization.get("location")}
        document = json.loads(body or b"{}")
        faults = [f"{name} is no part of the body" for name in located & set(document)]
        faults += list(faults_of(document, shape))
    assert faults == [], f"{operation_model.name}: {faults}"
    if operation_model.http.get("responseCode") and status < 300 and "Invoke" not in operation_model.name:
        assert status == operation_model.http["responseCode"]


@contextmanager
def lambda_gateway(folder: Path, **settings: Any) -> Iterator[LambdaGateway]:
    """Serve until the end of the block."""
    up, stop = threading.Event(), asyncio.Event()
    found: list[Any] = []

    async def serve() -> None:
        try:
            async with running_gateway(folder, **settings) as ready:
                found.extend((ready, asyncio.get_running_loop()))
                up.set()
                await stop.wait()
        finally:
            up.set()

    thread = threading.Thread(target=lambda: asyncio.run(serve()), name="lambda gateway")
    thread.start()
    try:
        up.wait(60)
        assert found, "the gateway did not start"
        yield LambdaGateway(found[0], folder / "data", found[1])
    finally:
        if found:
            found[1].call_soon_threadsafe(stop.set)
        thread.join(60)
        assert not thread.is_alive()
