"""Events in the shapes that handlers expect: EventBridge's above all, and those that others of AWS give."""

from __future__ import annotations

import hashlib
from base64 import b64encode
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from typing import Any
from urllib.parse import quote_plus

import orjson

from gateway.domain.automation.gateway_event import JOURNAL, GatewayEvent

__all__ = ["ACCOUNT", "REGION", "SHAPES", "cloudevent", "eventbridge", "http_v2", "kinesis", "moment", "s3", "sqs"]

ACCOUNT, REGION = "000000000000", "local"
STORED = f"{JOURNAL}.recording.stored"
Shape = Callable[[GatewayEvent], dict[str, Any]]


def moment(at_ns: int, timespec: str = "milliseconds") -> str:
    """A time in UTC as RFC 3339 writes it."""
    return datetime.fromtimestamp(at_ns / 1e9, UTC).isoformat(timespec=timespec).replace("+00:00", "Z")


def eventbridge(one: GatewayEvent) -> dict[str, Any]:
    """As EventBridge gives events to its targets; `detail` names the robot."""
    return {
        "version": "0",
        "id": one.id,
        "detail-type": one.type,
        "source": one.source,
        "account": ACCOUNT,
        "time": moment(one.at_ns, "seconds"),
        "region": REGION,
        "resources": [f"arn:metaros:robot:{one.robot}"] if one.robot else [],
        "detail": {"robot": one.robot, **one.data} if one.robot else dict(one.data),
    }


def cloudevent(one: GatewayEvent) -> dict[str, Any]:
    """As CloudEvents 1.0 has it; `subject` is the robot."""
    document: dict[str, Any] = {
        "specversion": "1.0",
        "id": one.id,
        "source": one.source,
        "type": one.type,
        "time": moment(one.at_ns),
        "datacontenttype": "application/json",
        "data": dict(one.data),
    }
    if one.robot:
        document["subject"] = one.robot
    return document


def s3(one: GatewayEvent) -> dict[str, Any]:
    """A recording that is complete, as S3 tells of an object that was put; ValueError for what is no such thing."""
    if one.type != STORED:
        raise ValueError(f"only {STORED} has the shape of S3, and this is {one.type}")
    key = f"recordings/{one.robot}/{one.data.get('recording', '')}.mcap"
    record = {
        "eventVersion": "2.1",
        "eventSource": "aws:s3",
        "awsRegion": REGION,
        "eventTime": moment(one.at_ns),
        "eventName": "ObjectCreated:Put",
        "userIdentity": {"principalId": one.robot},
        "requestParameters": {"sourceIPAddress": "127.0.0.1"},
        "responseElements": {"x-amz-request-id": one.id, "x-amz-id-2": one.id},
        "s3": {
            "s3SchemaVersion": "1.0",
            "configurationId": JOURNAL,
            "bucket": {"name": JOURNAL, "ownerIdentity": {"principalId": ACCOUNT}, "arn": f"arn:aws:s3:::{JOURNAL}"},
            "object": {
                "key": quote_plus(key, safe="/"),
                "size": one.data.get("size_bytes", 0),
                "eTag": hashlib.md5(key.encode(), usedforsecurity=False).hexdigest(),  # its file never changes
                "sequencer": f"{one.at_ns:016X}",
            },
        },
    }
    return {"Records": [record]}


def sqs(many: Sequence[GatewayEvent], arn: str = f"arn:aws:sqs:{REGION}:{ACCOUNT}:metaros") -> dict[str, Any]:
    """A batch as SQS gives it; each body is the EventBridge shape, `messageId` the event's id."""
    return {"Records": [_message(one, arn) for one in many]}


def kinesis(
    many: Sequence[GatewayEvent], arn: str = f"arn:aws:kinesis:{REGION}:{ACCOUNT}:stream/metaros"
) -> dict[str, Any]:
    """A batch as a Kinesis stream gives it; `data` is the EventBridge shape in base64, the sequence number its id."""
    return {"Records": [_record(one, arn) for one in many]}


def http_v2(one: GatewayEvent) -> dict[str, Any]:
    """What came in by a webhook, as an HTTP API gives it (payload format 2.0)."""
    said: Mapping[str, Any] = one.data
    path = f"/api/v1/hooks/{said.get('hook', '')}"
    return {
        "version": "2.0",
        "routeKey": f"POST {path}",
        "rawPath": path,
        "rawQueryString": "",
        "headers": dict(said.get("headers", {})),
        "requestContext": {
            "accountId": ACCOUNT,
            "apiId": JOURNAL,
            "http": {"method": "POST", "path": path, "protocol": "HTTP/1.1", "sourceIp": "", "userAgent": ""},
            "requestId": one.id,
            "routeKey": f"POST {path}",
            "stage": "$default",
            "time": datetime.fromtimestamp(one.at_ns / 1e9, UTC).strftime("%d/%b/%Y:%H:%M:%S +0000"),
            "timeEpoch": one.at_ns // 10**6,
        },
        "body": orjson.dumps(said.get("body", dict(said))).decode(),
        "isBase64Encoded": False,
    }


def _message(one: GatewayEvent, arn: str) -> dict[str, Any]:
    body = orjson.dumps(eventbridge(one))
    at_ms = str(one.at_ns // 10**6)
    return {
        "messageId": one.id,
        "receiptHandle": one.id,
        "body": body.decode(),
        "attributes": {
            "ApproximateReceiveCount": "1",
            "SentTimestamp": at_ms,
            "SenderId": one.robot or one.source,
            "ApproximateFirstReceiveTimestamp": at_ms,
        },
        "messageAttributes": {},
        "md5OfBody": hashlib.md5(body, usedforsecurity=False).hexdigest(),
        "eventSource": "aws:sqs",
        "eventSourceARN": arn,
        "awsRegion": REGION,
    }


def _record(one: GatewayEvent, arn: str) -> dict[str, Any]:
    return {
        "kinesis": {
            "kinesisSchemaVersion": "1.0",
            "partitionKey": one.robot or one.source,
            "sequenceNumber": one.id,
            "data": b64encode(orjson.dumps(eventbridge(one))).decode(),
            "approximateArrivalTimestamp": one.at_ns / 1e9,
        },
        "eventSource": "aws:kinesis",
        "eventVersion": "1.0",
        "eventID": one.id,
        "eventName": "aws:kinesis:record",
        "invokeIdentityArn": f"arn:aws:iam::{ACCOUNT}:role/metaros",
        "awsRegion": REGION,
        "eventSourceARN": arn,
    }


# By the name that a rule's `event_format` has; what gives batches gives one of a single event.
SHAPES: dict[str, Shape] = {
    "eventbridge": eventbridge,
    "cloudevents": cloudevent,
    "s3": s3,
    "sqs": lambda one: sqs((one,)),
    "kinesis": lambda one: kinesis((one,)),
    "http-v2": http_v2,
}
