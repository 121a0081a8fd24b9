"""Our client of the Runtime API, without a worker: handlers found, errors told, contexts made."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from metaros.automation.functions.runtime.client_context import context_of
from metaros.automation.functions.runtime.client_errors import Failure, Fault
from metaros.automation.functions.runtime.client_logs import LogSink
from metaros.automation.functions.runtime.runtime_client import find_handler
from tests.support.tables import cases


def test_a_handler_in_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "of_test_folder").mkdir()
    (tmp_path / "of_test_folder" / "inside.py").write_text("def handler(e, c): return 'found'\n")
    monkeypatch.syspath_prepend(tmp_path)
    assert find_handler("of_test_folder/inside.handler")(None, None) == "found"
    assert find_handler("of_test_folder.inside.handler")(None, None) == "found"


@cases(
    ("name", "kind"),
    [
        ("nodot", "Runtime.MalformedHandlerName"),
        ("", "Runtime.MalformedHandlerName"),
        ("not_there_at_all.handler", "Runtime.ImportModuleError"),
        ("json.no_such_handler", "Runtime.HandlerNotFound"),
        ("sys.exit", "Runtime.BuiltInModuleConflict"),
    ],
)
def test_no_handler(name: str, kind: str) -> None:
    with pytest.raises(Fault) as caught:
        find_handler(name)
    assert caught.value.kind == kind
    assert Failure(caught.value).document["errorType"] == kind
    assert Failure(caught.value).document["stackTrace"] == []


def test_a_failure_shows_the_handlers_own_frames() -> None:
    def broken() -> None:
        raise KeyError("battery")

    with pytest.raises(KeyError) as caught:
        broken()
    failure = Failure(caught.value, request_id="r")
    document = failure.document
    assert (document["errorType"], document["errorMessage"], document["requestId"]) == ("KeyError", "'battery'", "r")
    assert "in broken" in document["stackTrace"][-1]
    assert failure.text.startswith("[ERROR] KeyError: 'battery'\nTraceback (most recent call last):\n")
    cause = json.loads(failure.cause)
    assert cause["exceptions"][0]["type"] == "KeyError"
    assert cause["paths"] == [__file__]


def test_a_cause_over_a_mib_is_left_out() -> None:
    assert Failure(ValueError("x" * 1_100_000)).cause == ""
    assert len(Failure(ValueError("x" * 1_000_000)).cause) > 1_000_000
    assert "\n" not in Failure(ValueError("a\nb")).cause, "it is a header"


def test_a_context() -> None:
    client = {"custom": {"a": 1}, "client": {"app_title": "t", "other": 1}, "w3c": {"baggage": "b", "evil": 1}}
    context = context_of(
        {
            "lambda-runtime-aws-request-id": "r",
            "lambda-runtime-deadline-ms": "1",
            "lambda-runtime-client-context": json.dumps(client),
            "lambda-runtime-cognito-identity": '{"cognitoIdentityId": "i"}',
        }
    )
    assert context.aws_request_id == "r"
    assert context.get_remaining_time_in_millis() == 0
    assert context.client_context is not None
    assert context.client_context.client.app_title == "t"
    assert context.client_context.client.installation_id is None
    assert not hasattr(context.client_context, "w3c")
    assert context.w3c() == {"baggage": "b"}
    assert context.identity.cognito_identity_id == "i"
    assert "aws_request_id=r" in repr(context)
    assert "deadline" not in repr(context)


@cases("text", ["{", "nonsense"])
def test_a_context_that_is_no_json(text: str) -> None:
    with pytest.raises(Fault) as caught:
        context_of({"lambda-runtime-client-context": text})
    assert caught.value.kind == "Runtime.LambdaContextUnmarshalError"


def test_without_a_descriptor_of_its_own_the_log_is_stdout(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delenv("_LAMBDA_TELEMETRY_LOG_FD", raising=False)
    LogSink().write("a message\n")
    assert capsys.readouterr().out == "a message\n"


def test_it_imports_nothing_slow() -> None:
    code = "import sys, metaros.automation.functions.runtime.runtime_client; print(*sys.modules)"
    reported = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = set(reported.stdout.split())
    assert not loaded & {"asyncio", "httpx", "numpy", "zenoh", "grpc", "ssl", "http.client", "boto3"}
