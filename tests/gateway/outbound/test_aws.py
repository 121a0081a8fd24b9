"""Records reach AWS as moto has it: queues, topics, buses and buckets by their ARNs."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import boto3
import pytest
from moto import mock_aws

from gateway.outbound.aws import AwsDestinations
from tests.support.gateways.quick_boto import read_documents_once

read_documents_once()
REGION, ACCOUNT = "eu-central-1", "123456789012"
FACTS: dict[str, Any] = {"function": "arn:aws:lambda:local:000000000000:function:f:$LATEST", "side": "Failure"}
FACTS["delivery"] = "d-1"


@pytest.fixture(scope="module", autouse=True)
def aws() -> Iterator[None]:
    """Nobody's real account."""
    with pytest.MonkeyPatch.context() as patch, mock_aws():
        patch.setenv("AWS_ACCESS_KEY_ID", "testing")
        patch.setenv("AWS_SECRET_ACCESS_KEY", "testing")
        patch.setenv("AWS_DEFAULT_REGION", "us-east-1")
        yield


@pytest.fixture(scope="module")
def destinations() -> Iterator[AwsDestinations]:
    """Without an endpoint of its own."""
    made = AwsDestinations()
    yield made
    made.close()


@pytest.fixture(scope="module")
def sqs() -> Any:
    return boto3.client("sqs", region_name=REGION)


async def test_a_queue_gets_the_record_and_a_dead_letter_its_attributes(
    sqs: Any, destinations: AwsDestinations
) -> None:
    url = sqs.create_queue(QueueName="ends")["QueueUrl"]
    arn = sqs.get_queue_attributes(QueueUrl=url, AttributeNames=["QueueArn"])["Attributes"]["QueueArn"]
    sent = await destinations.send(arn, b'{"a":1}', {**FACTS, "attributes": {"ErrorCode": "200", "RequestID": "r"}})
    (message,) = sqs.receive_message(QueueUrl=url, MessageAttributeNames=["All"])["Messages"]
    assert message["MessageId"] == sent
    assert json.loads(message["Body"]) == {"a": 1}
    assert message["MessageAttributes"]["RequestID"]["StringValue"] == "r"


async def test_a_fifo_queue_takes_a_delivery_once(sqs: Any, destinations: AwsDestinations) -> None:
    url = sqs.create_queue(QueueName="ends.fifo", Attributes={"FifoQueue": "true"})["QueueUrl"]
    arn = sqs.get_queue_attributes(QueueUrl=url, AttributeNames=["QueueArn"])["Attributes"]["QueueArn"]
    for _ in range(2):
        await destinations.send(arn, b"{}", FACTS)
    assert len(sqs.receive_message(QueueUrl=url, MaxNumberOfMessages=10)["Messages"]) == 1


async def test_topics_buses_and_buckets(destinations: AwsDestinations) -> None:
    session = boto3.Session()
    topic = session.client("sns", region_name=REGION).create_topic(Name="t")["TopicArn"]
    assert await destinations.send(topic, b"{}", FACTS)
    bus = session.client("events", region_name=REGION).create_event_bus(Name="b")["EventBusArn"]
    assert await destinations.send(bus, b'{"a":1}', FACTS)
    s3: Any = session.client("s3", region_name="us-east-1")
    s3.create_bucket(Bucket="records")
    key = await destinations.send("arn:aws:s3:::records", b'{"a":1}', FACTS)
    assert key == "aws/lambda/async/f/d-1.json"
    assert s3.get_object(Bucket="records", Key=key)["Body"].read() == b'{"a":1}'


@pytest.mark.parametrize("arn", ["nothing", "arn:aws:dynamodb:eu-central-1:1:table/t", "arn:aws:sqs"])
async def test_what_is_no_destination_is_refused(destinations: AwsDestinations, arn: str) -> None:
    with pytest.raises(ConnectionError, match="no queue, topic"):
        await destinations.send(arn, b"{}", FACTS)


async def test_what_aws_refuses_is_said(destinations: AwsDestinations) -> None:
    with pytest.raises(ConnectionError, match="sqs refuses"):
        await destinations.send(f"arn:aws:sqs:{REGION}:{ACCOUNT}:none", b"{}", FACTS)
