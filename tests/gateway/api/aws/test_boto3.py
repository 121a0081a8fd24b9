"""Unmodified boto3 against a running gateway: functions are made, called and deleted."""

from __future__ import annotations

import base64
import json
from typing import Any

import pytest

from tests.support.gateways.lambda_gateway import ROLE, LambdaGateway, zipped

SOURCE = """
import os

def handler(event, context):
    if event.get("print"):
        print(event["print"])
    if event.get("fail"):
        raise ValueError(event["fail"])
    return {"said": event, "version": context.function_version, "mode": os.environ.get("MODE", "")}
"""


def make(aws: Any, name: str, source: str = SOURCE, **members: Any) -> Any:
    """A function with that code."""
    usual = {"Runtime": "python3.12", "Role": ROLE, "Handler": "app.handler", "Code": {"ZipFile": zipped(source)}}
    return aws.create_function(FunctionName=name, **{**usual, **members})


def call(aws: Any, name: str, event: Any, **members: Any) -> Any:
    """What a call comes to, its payload read."""
    answer = aws.invoke(FunctionName=name, Payload=json.dumps(event), **members)
    return {**answer, "Payload": json.loads(answer["Payload"].read() or "null")}


def test_a_function_is_made_called_listed_and_deleted(aws: Any) -> None:
    made = make(aws, "first", Environment={"Variables": {"MODE": "fast"}}, MemorySize=256)
    assert made["FunctionArn"] == "arn:aws:lambda:local:000000000000:function:first"
    assert (made["State"], made["MemorySize"], made["Timeout"]) == ("Active", 256, 3)
    aws.get_waiter("function_active_v2").wait(FunctionName="first")
    answer = call(aws, "first", {"a": 1}, LogType="Tail")
    assert answer["Payload"] == {"said": {"a": 1}, "version": "$LATEST", "mode": "fast"}
    assert (answer["StatusCode"], answer["ExecutedVersion"]) == (200, "$LATEST")
    assert "FunctionError" not in answer
    assert b"REPORT RequestId" in base64.b64decode(answer["LogResult"])
    assert "first" in [item["FunctionName"] for item in aws.list_functions()["Functions"]]
    aws.delete_function(FunctionName="first")
    with pytest.raises(aws.exceptions.ResourceNotFoundException):
        aws.get_function(FunctionName="first")


def test_a_failure_is_reported_in_the_answer(aws: Any) -> None:
    make(aws, "failing")
    answer = call(aws, "failing", {"fail": "no way"})
    assert (answer["StatusCode"], answer["FunctionError"]) == (200, "Unhandled")
    assert (answer["Payload"]["errorType"], answer["Payload"]["errorMessage"]) == ("ValueError", "no way")


def test_a_dry_run_calls_nothing(aws: Any) -> None:
    make(aws, "dry")
    assert aws.invoke(FunctionName="dry", InvocationType="DryRun")["StatusCode"] == 204
    with pytest.raises(aws.exceptions.ResourceNotFoundException):
        aws.invoke(FunctionName="nobody", InvocationType="DryRun")


def test_every_form_of_a_name_is_taken(aws: Any, served: LambdaGateway) -> None:
    arn = make(aws, "named")["FunctionArn"]
    for name in ("named", arn, "000000000000:function:named", "function:named", f"{arn}:$LATEST", "named:$LATEST"):
        assert aws.get_function_configuration(FunctionName=name)["FunctionName"] == "named", name
    with pytest.raises(aws.exceptions.ResourceNotFoundException):
        aws.get_function_configuration(FunctionName=arn.replace("000000000000", "123456789012"))
    assert call(served.client(region="eu-central-1"), arn, {"x": 2})["Payload"]["said"] == {"x": 2}
