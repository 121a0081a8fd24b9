"""Shapes of events, field by field as AWS documents them in the example events of Lambda's guide."""

from __future__ import annotations

import hashlib
from base64 import b64decode
from datetime import datetime
from typing import Any

import orjson
import pytest

from gateway.domain.automation.gateway_event import WEBHOOK, GatewayEvent
from gateway.domain.automation.shapes import SHAPES, cloudevent, eventbridge, http_v2, s3

AT = 1_790_000_000_123_000_000
STORED = GatewayEvent(
    id="e-7",
    type="metaros.recording.stored",
    source="metaros",
    at_ns=AT,
    robot="lab 1",
    data={"recording": "01J", "size_bytes": 4096},
)


def record(shape: str) -> dict[str, Any]:
    """The one record of a document that has nothing else."""
    document = SHAPES[shape](STORED)
    assert list(document) == ["Records"]
    [found] = document["Records"]
    return dict(found)


def test_eventbridge() -> None:
    assert eventbridge(STORED) == {
        "version": "0",
        "id": "e-7",
        "detail-type": "metaros.recording.stored",
        "source": "metaros",
        "account": "000000000000",
        "time": "2026-09-21T14:13:20Z",
        "region": "local",
        "resources": ["arn:metaros:robot:lab 1"],
        "detail": {"robot": "lab 1", "recording": "01J", "size_bytes": 4096},
    }


def test_cloudevents() -> None:
    found = cloudevent(STORED)
    assert {"specversion", "id", "source", "type"} <= set(found)  # what every one has to have
    assert found["specversion"] == "1.0"
    assert (found["subject"], found["datacontenttype"]) == ("lab 1", "application/json")
    assert datetime.fromisoformat(found["time"]).timestamp() == pytest.approx(AT / 1e9)
    assert found["data"] == STORED.data


def test_s3_tells_of_an_object_that_was_put() -> None:
    found = record("s3")
    assert set(found) == {
        "eventVersion",
        "eventSource",
        "awsRegion",
        "eventTime",
        "eventName",
        "userIdentity",
        "requestParameters",
        "responseElements",
        "s3",
    }
    assert (found["eventSource"], found["eventName"]) == ("aws:s3", "ObjectCreated:Put")
    assert found["eventTime"] == "2026-09-21T14:13:20.123Z"
    assert set(found["userIdentity"]) == {"principalId"}
    assert set(found["requestParameters"]) == {"sourceIPAddress"}
    assert set(found["responseElements"]) == {"x-amz-request-id", "x-amz-id-2"}
    inner = found["s3"]
    assert set(inner) == {"s3SchemaVersion", "configurationId", "bucket", "object"}
    assert set(inner["bucket"]) == {"name", "ownerIdentity", "arn"}
    assert set(inner["object"]) == {"key", "size", "eTag", "sequencer"}
    assert (inner["object"]["key"], inner["object"]["size"]) == ("recordings/lab+1/01J.mcap", 4096)
    assert len(bytes.fromhex(inner["object"]["eTag"])) == 16
    with pytest.raises(ValueError, match="recording"):
        s3(GatewayEvent(id="1", type="metaros.robot.online", source="metaros", at_ns=AT))


def test_sqs_has_messages_of_a_queue() -> None:
    found = record("sqs")
    assert set(found) == {
        "messageId",
        "receiptHandle",
        "body",
        "attributes",
        "messageAttributes",
        "md5OfBody",
        "eventSource",
        "eventSourceARN",
        "awsRegion",
    }
    assert set(found["attributes"]) == {
        "ApproximateReceiveCount",
        "SentTimestamp",
        "SenderId",
        "ApproximateFirstReceiveTimestamp",
    }
    assert all(isinstance(value, str) for value in found["attributes"].values())
    assert found["attributes"]["SentTimestamp"] == "1790000000123"
    assert (found["messageId"], found["eventSource"]) == ("e-7", "aws:sqs")
    assert orjson.loads(found["body"]) == eventbridge(STORED)
    assert found["md5OfBody"] == hashlib.md5(found["body"].encode(), usedforsecurity=False).hexdigest()


def test_kinesis_has_records_of_a_stream() -> None:
    found = record("kinesis")
    assert set(found) == {
        "kinesis",
        "eventSource",
        "eventVersion",
        "eventID",
        "eventName",
        "invokeIdentityArn",
        "awsRegion",
        "eventSourceARN",
    }
    inner = found["kinesis"]
    assert set(inner) == {
        "kinesisSchemaVersion",
        "partitionKey",
        "sequenceNumber",
        "data",
        "approximateArrivalTimestamp",
    }
    assert (found["eventSource"], found["eventName"]) == ("aws:kinesis", "aws:kinesis:record")
    assert inner["approximateArrivalTimestamp"] == pytest.approx(AT / 1e9)  # seconds, with a fraction
    assert orjson.loads(b64decode(inner["data"])) == eventbridge(STORED)


def test_a_webhook_as_an_http_api_gives_it() -> None:
    hook = GatewayEvent(
        id="m1", type=WEBHOOK, source="metaros.webhook/ci", at_ns=AT, data={"hook": "ci", "body": {"ok": True}}
    )
    found = http_v2(hook)
    assert (found["version"], found["routeKey"]) == ("2.0", "POST /api/v1/hooks/ci")
    assert orjson.loads(found["body"]) == {"ok": True}
    assert found["requestContext"]["timeEpoch"] == AT // 10**6
    assert found["requestContext"]["time"] == "21/Sep/2026:14:13:20 +0000"
