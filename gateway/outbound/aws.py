"""Records of functions' ends for real AWS: a queue, a topic, a bus, a function or a bucket, named by its ARN.

The credentials are this machine's, found as boto3 finds them; a function never has them.
"""

from __future__ import annotations

import asyncio
import json
import threading
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Final

__all__ = ["AwsDestinations"]

WORKERS: Final = 4
CONNECT_S, READ_S = 5.0, 20.0
RESULT_TYPE: Final = "Lambda Function Invocation Result - "
Client = Any


class AwsDestinations:
    """Sends from any task; what boto3 does, it does on threads of its own. `endpoint` "" is AWS itself."""

    def __init__(self, *, endpoint: str = "", region: str = "") -> None:
        self._endpoint = endpoint
        self._region = region
        self._clients: dict[tuple[str, str], Client] = {}
        self._making = threading.Lock()
        self._session: Any = None
        self._pool = ThreadPoolExecutor(max_workers=WORKERS, thread_name_prefix="gateway-aws")

    async def send(self, arn: str, payload: bytes, facts: Mapping[str, Any]) -> str:
        """Give a record to what the ARN names; its id there. ConnectionError says why not."""
        parts = arn.split(":", 5)
        way = WAYS.get(parts[2]) if len(parts) == 6 and parts[0] == "arn" else None
        if way is None:
            raise ConnectionError(f"{arn[:200]!r} is no queue, topic, bus, function or bucket of AWS")
        job = (way, parts, payload.decode("utf-8", "replace"), dict(facts))
        return await asyncio.get_running_loop().run_in_executor(self._pool, self._send, *job)

    def close(self) -> None:
        """Let the threads go."""
        self._pool.shutdown(wait=False, cancel_futures=True)

    def _send(self, way: Way, parts: list[str], body: str, facts: Mapping[str, Any]) -> str:
        from botocore.exceptions import BotoCoreError, ClientError

        try:
            return way(self._client(parts[2], parts[3]), parts, body, facts)
        except ClientError as error:
            raise ConnectionError(f"{parts[2]} refuses: {str(error)[:500]}") from error
        except BotoCoreError as error:
            raise ConnectionError(f"{parts[2]}: {str(error)[:500]}") from error

    def _client(self, service: str, region: str) -> Client:
        key = (service, region or self._region)
        with self._making:  # a session is for one thread at a time, its clients are not
            found = self._clients.get(key)
            if found is None:
                import boto3
                from botocore.config import Config

                config = Config(
                    connect_timeout=CONNECT_S,
                    read_timeout=READ_S,
                    retries={"max_attempts": 0},  # the queue tries again
                    max_pool_connections=WORKERS,
                )
                self._session = self._session or boto3.session.Session()  # it reads all endpoints there are
                make: Any = self._session.client
                found = self._clients[key] = make(
                    service, region_name=key[1] or None, endpoint_url=self._endpoint or None, config=config
                )
        return found


Way = Callable[[Client, list[str], str, Mapping[str, Any]], str]


def _sqs(client: Client, parts: list[str], body: str, facts: Mapping[str, Any]) -> str:
    url = client.get_queue_url(QueueName=parts[5], QueueOwnerAWSAccountId=parts[4])["QueueUrl"]
    options: dict[str, Any] = {}
    if parts[5].endswith(".fifo"):
        options = {"MessageGroupId": str(facts.get("function", "metaros"))[-128:]}
        options["MessageDeduplicationId"] = str(facts["delivery"])
    sent = client.send_message(QueueUrl=url, MessageBody=body, MessageAttributes=_attributes(facts), **options)
    return str(sent["MessageId"])


def _sns(client: Client, parts: list[str], body: str, facts: Mapping[str, Any]) -> str:
    answer = client.publish(TopicArn=":".join(parts), Message=body, MessageAttributes=_attributes(facts))
    return str(answer["MessageId"])


def _events(client: Client, parts: list[str], body: str, facts: Mapping[str, Any]) -> str:
    entry = {
        "Source": "lambda",
        "DetailType": f"{RESULT_TYPE}{facts.get('side', '')}",
        "Detail": body if body.lstrip().startswith("{") else json.dumps({"payload": body}),
        "EventBusName": ":".join(parts),
        "Resources": [str(facts.get("function", "")), ":".join(parts)],
    }
    answer = client.put_events(Entries=[entry])
    if answer.get("FailedEntryCount"):
        raise ConnectionError(f"events refuses: {answer['Entries'][0].get('ErrorMessage', '')}")
    return str(answer["Entries"][0]["EventId"])


def _lambda(client: Client, parts: list[str], body: str, facts: Mapping[str, Any]) -> str:
    answer = client.invoke(FunctionName=":".join(parts), InvocationType="Event", Payload=body.encode())
    return str(answer["ResponseMetadata"].get("RequestId", ""))


def _s3(client: Client, parts: list[str], body: str, facts: Mapping[str, Any]) -> str:
    function = str(facts.get("function", "")).rpartition("function:")[2].partition(":")[0]
    key = f"aws/lambda/async/{function}/{facts['delivery']}.json"
    client.put_object(Bucket=parts[5], Key=key, Body=body.encode(), ContentType="application/json")
    return key


def _attributes(facts: Mapping[str, Any]) -> dict[str, Any]:
    """A dead letter says in attributes what was wrong with it."""
    said = facts.get("attributes") or {}
    return {name: {"DataType": "String", "StringValue": str(value)} for name, value in said.items() if value}


WAYS: Final[dict[str, Way]] = {"sqs": _sqs, "sns": _sns, "events": _events, "lambda": _lambda, "s3": _s3}
