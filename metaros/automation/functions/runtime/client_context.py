"""The `context` argument of a handler, as in AWS Lambda for Python."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

from metaros.automation.functions.runtime.client_errors import Fault
from metaros.clock import SystemClock

__all__ = ["LambdaContext", "context_of"]

_CLIENT = ("installation_id", "app_title", "app_version_name", "app_version_code", "app_package_name")
_W3C = ("traceparent", "tracestate", "baggage")
_CLOCK = SystemClock()


class LambdaContext:
    """One call: its ids, its function and how long it still has."""

    def __init__(self, *, request_id: str, arn: str, deadline_ms: int, client: Any, identity: Any) -> None:
        environ = os.environ
        self.aws_request_id = request_id
        self.invoked_function_arn = arn
        self.function_name = environ.get("AWS_LAMBDA_FUNCTION_NAME")
        self.function_version = environ.get("AWS_LAMBDA_FUNCTION_VERSION")
        self.memory_limit_in_mb = environ.get("AWS_LAMBDA_FUNCTION_MEMORY_SIZE")
        self.log_group_name = environ.get("AWS_LAMBDA_LOG_GROUP_NAME")
        self.log_stream_name = environ.get("AWS_LAMBDA_LOG_STREAM_NAME")
        self.tenant_id: str | None = None
        self._w3c = _w3c_of(client)
        self.client_context = _client_of(client)
        self.identity = SimpleNamespace(
            cognito_identity_id=_get(identity, "cognitoIdentityId"),
            cognito_identity_pool_id=_get(identity, "cognitoIdentityPoolId"),
        )
        self._deadline_ms = deadline_ms

    def get_remaining_time_in_millis(self) -> int:
        """Milliseconds until the call is ended; never below 0."""
        return max(0, self._deadline_ms - _CLOCK.wall_ns() // 1_000_000)

    def w3c(self) -> dict[str, str]:
        """The W3C trace context of the call."""
        return dict(self._w3c)

    def log(self, message: object) -> None:
        """Write to the function's log as it is."""
        print(message, end="", flush=True)

    def __repr__(self) -> str:
        return f"LambdaContext([{', '.join(f'{k}={v}' for k, v in vars(self).items() if k[0] != '_')}])"


def context_of(headers: Mapping[str, str]) -> LambdaContext:
    """The context from the headers of a call.

    Raises:
        Fault: a header is not the JSON that it should be.
    """
    return LambdaContext(
        request_id=headers.get("lambda-runtime-aws-request-id", ""),
        arn=headers.get("lambda-runtime-invoked-function-arn", ""),
        deadline_ms=int(headers.get("lambda-runtime-deadline-ms", "0")),
        client=_json(headers, "lambda-runtime-client-context", "Client Context"),
        identity=_json(headers, "lambda-runtime-cognito-identity", "Cognito Identity"),
    )


def _json(headers: Mapping[str, str], name: str, title: str) -> Any:
    text = headers.get(name)
    if not text:
        return None
    try:
        return json.loads(text)
    except ValueError as error:
        raise Fault("Runtime.LambdaContextUnmarshalError", f"Unable to parse {title} JSON: {error}") from error


def _get(document: Any, name: str) -> Any:
    return document.get(name) if isinstance(document, dict) else None


def _w3c_of(client: Any) -> dict[str, str]:
    """Taken out of the client context: it is shown by `w3c` alone."""
    fields = client.pop("w3c", None) if isinstance(client, dict) else None
    return {name: fields[name] for name in _W3C if isinstance(_get(fields, name), str)} if fields else {}


def _client_of(document: Any) -> SimpleNamespace | None:
    if not isinstance(document, dict):
        return None
    client = document.get("client")
    known = SimpleNamespace(**{name: client.get(name) for name in _CLIENT}) if isinstance(client, dict) else None
    return SimpleNamespace(custom=document.get("custom"), env=document.get("env"), client=known)
