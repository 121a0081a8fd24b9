"""Gives what a rule fires on to AWS: Lambda, SNS, SQS, EventBridge and S3, through boto3 on threads of its own.

Region and endpoint are the gateway's settings, a region also a target's; credentials come from where boto3 looks for
them: the environment, files, the machine's role. A rule's document never has any.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import orjson

from gateway.automation.rules.targets.calls import Calls, RuleContext
from gateway.domain.automation.delivery import Dead, Delivery, Done, Result, Retry
from metaros.limits import LIMITS

__all__ = ["AwsTarget", "aws_client"]

Client = Any  # boto3 makes its classes when it runs
MakeClient = Callable[[str, str], Client]  # service and region
CONNECT_S = 5.0
# Errors that another try does not mend; all others are tried again, throttling without counting as an attempt.
HOPELESS = frozenset(
    {
        "AccessDenied",
        "AccessDeniedException",
        "AuthorizationErrorException",
        "InvalidAddress",
        "InvalidMessageContents",
        "InvalidParameter",
        "InvalidParameterException",
        "InvalidParameterValueException",
        "InvalidRequestContentException",
        "NoSuchBucket",
        "NotFound",
        "NotFoundException",
        "AWS.SimpleQueueService.NonExistentQueue",
        "QueueDoesNotExist",
        "RequestTooLargeException",
        "EntityTooLarge",
        "ResourceNotFoundException",
        "ValidationException",
    }
)
THROTTLED = frozenset(
    {"Throttling", "ThrottlingException", "TooManyRequestsException", "RequestThrottled", "SlowDown", "Throttled"}
)


def aws_client(service: str, region: str, *, endpoint: str = "") -> Client:
    """A client of boto3 that tries once: the queue tries again. Takes long; for a thread."""
    import boto3
    from botocore.config import Config

    config = Config(
        connect_timeout=CONNECT_S,
        read_timeout=LIMITS.target_s - CONNECT_S,
        retries={"total_max_attempts": 1},
        max_pool_connections=LIMITS.aws_calls,
        s3={"addressing_style": "path" if endpoint else "auto"},
        request_checksum_calculation="when_required",
    )
    session = boto3.session.Session()
    make: Any = session.client
    return make(service, region_name=region or session.region_name, endpoint_url=endpoint or None, config=config)


class AwsTarget:
    """A handler of the queue."""

    def __init__(self, make_client: MakeClient, *, region: str = "") -> None:
        self._calls = Calls(most=LIMITS.aws_calls)
        self.room, self.timeout_s, self.ended = self._calls.room, self._calls.timeout_s, self._calls.ended
        self._make_client = make_client
        self._region = region
        self._clients: dict[tuple[str, str], Client] = {}
        self._pool = ThreadPoolExecutor(max_workers=LIMITS.aws_calls, thread_name_prefix="gateway-aws")

    async def deliver(self, delivery: Delivery) -> Result:
        """One call of AWS."""
        with self._calls.counted():
            return await asyncio.get_running_loop().run_in_executor(self._pool, self._deliver, delivery)

    def close(self) -> None:
        """Take nothing more."""
        self._pool.shutdown(wait=False, cancel_futures=True)

    def _deliver(self, delivery: Delivery) -> Result:
        from botocore.exceptions import BotoCoreError, ClientError

        rule_context = RuleContext(delivery)
        service = str(rule_context.fields["service"])
        try:
            client = self._client(service, str(rule_context.fields.get("region") or self._region))
            return Done(str(CALLS[service](client, rule_context, delivery))[:200])
        except ClientError as error:
            said: Mapping[str, Any] = error.response.get("Error", {})
            code = str(said.get("Code", "aws"))
            if code in HOPELESS:
                return Dead("aws_refused", str(error))
            return Retry("aws_failed", str(error), counts=code not in THROTTLED)
        except BotoCoreError as error:  # no network, no credentials
            return Retry("aws_unreachable", str(error))
        except _Refused as error:
            return Retry("aws_failed", str(error))

    def _client(self, service: str, region: str) -> Client:
        """Made once for each service and region: that takes a tenth of a second. Two at once make two, one is kept."""
        found = self._clients.get((service, region))
        return found or self._clients.setdefault((service, region), self._make_client(service, region))


class _Refused(Exception):
    """AWS took the call, and not what was in it."""


def _invoke(client: Client, rule_context: RuleContext, delivery: Delivery) -> str:
    said = {"Qualifier": rule_context.fields["qualifier"]} if rule_context.fields.get("qualifier") else {}
    answer = client.invoke(
        FunctionName=rule_context.fields["function"], InvocationType="Event", Payload=rule_context.payload, **said
    )
    return str(answer["ResponseMetadata"].get("RequestId", ""))


def _publish(client: Client, rule_context: RuleContext, delivery: Delivery) -> str:
    arn, text = rule_context.fields["topic_arn"], rule_context.payload.decode()
    said = {"Subject": rule_context.fields["subject"]} if rule_context.fields.get("subject") else {}
    fifo = {"MessageDeduplicationId": delivery.id, "MessageGroupId": rule_context.robot or rule_context.rule}
    answer = client.publish(TopicArn=arn, Message=text, **said, **(fifo if arn.endswith(".fifo") else {}))
    return str(answer["MessageId"])


def _send(client: Client, rule_context: RuleContext, delivery: Delivery) -> str:
    url = rule_context.fields["queue_url"]
    fifo = {"MessageDeduplicationId": delivery.id, "MessageGroupId": rule_context.robot or rule_context.rule}
    answer = client.send_message(
        QueueUrl=url, MessageBody=rule_context.payload.decode(), **(fifo if url.endswith(".fifo") else {})
    )
    return str(answer["MessageId"])


def _put_events(client: Client, rule_context: RuleContext, delivery: Delivery) -> str:
    said = rule_context.document()
    whole = isinstance(said, dict)
    detail = said.get("detail", said) if whole else {"value": said}
    entry = {
        "Source": rule_context.fields.get("source") or str(said.get("source", "metaros") if whole else "metaros"),
        "DetailType": rule_context.fields.get("detail_type")
        or str(said.get("detail-type", "rule") if whole else "rule"),
        "Detail": orjson.dumps(detail if isinstance(detail, dict) else {"value": detail}).decode(),
        "Resources": said.get("resources", []) if whole and isinstance(said.get("resources"), list) else [],
    }
    bus = rule_context.fields.get("bus")
    answer = client.put_events(Entries=[entry | ({"EventBusName": bus} if bus else {})])
    (result,) = answer["Entries"]
    if answer["FailedEntryCount"]:
        raise _Refused(f"{result.get('ErrorCode')}: {result.get('ErrorMessage')}")
    return str(result["EventId"])


def _put_object(client: Client, rule_context: RuleContext, delivery: Delivery) -> str:
    """Under a name that is the delivery's, so that a second try replaces the first."""
    key = f"{rule_context.fields.get('prefix', '')}{rule_context.rule}/{delivery.id}.json"
    client.put_object(
        Bucket=rule_context.fields["bucket"], Key=key, Body=rule_context.payload, ContentType="application/json"
    )
    return key


CALLS: dict[str, Callable[[Client, RuleContext, Delivery], str]] = {
    "lambda": _invoke,
    "sns": _publish,
    "sqs": _send,
    "events": _put_events,
    "s3": _put_object,
}
