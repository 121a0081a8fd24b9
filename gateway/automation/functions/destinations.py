"""Who is told how an event for a function ended: destinations and dead-letter queues, in Lambda's words.

A destination is a function of this gateway, the gateway's own bus of events
(`arn:aws:events:local:000000000000:event-bus/default`), or a queue, topic, bus or function of real AWS.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any, Final

import orjson

from gateway.automation.functions.async_put import event_put, function_of
from gateway.automation.functions.directory import EventInvoke
from gateway.automation.functions.invoker import Invoked
from gateway.domain.automation.delivery import TOO_OLD, Dead, Delivery, Done, Policy, Put
from metaros.limits import LIMITS

__all__ = ["DESTINATION", "MOST_HOPS", "OWN", "Ending", "destination_put", "ending_puts", "own_function"]

DESTINATION: Final = "destination"  # the kind
OWN: Final = "arn:aws:lambda:local:000000000000:function:"
MOST_HOPS: Final = 16  # functions that tell functions that tell functions
CONDITIONS: Final = {TOO_OLD: "EventAgeExceeded"}
DLQ_MESSAGE_CHARS: Final = 1024
POLICY: Final = Policy(most_attempts=20, most_age_s=86_400.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Ending:
    """How an event ended; `answer` is None where its last attempt never came to the function."""

    delivery: Delivery
    result: Done | Dead
    answer: Invoked | None
    at_ns: int
    settings: EventInvoke

    @property
    def ok(self) -> bool:
        """Whether the function took it."""
        return isinstance(self.result, Done)

    @property
    def request_id(self) -> str:
        """What the function knew it by."""
        return str(self.delivery.put.context.get("request") or self.delivery.id)

    @property
    def arn(self) -> str:
        """The function's, with its qualifier."""
        name, qualifier = function_of(self.delivery.put.target)
        return f"{OWN}{name}:{qualifier or '$LATEST'}"

    def record(self) -> dict[str, Any]:
        """What a destination gets."""
        calls = self.delivery.attempts + (self.answer is not None)
        condition = "Success"
        if isinstance(self.result, Dead):
            condition = CONDITIONS.get(self.result.code, "RetriesExhausted")
        record: dict[str, Any] = {
            "version": "1.0",
            "timestamp": _iso(self.at_ns),
            "requestContext": {
                "requestId": self.request_id,
                "functionArn": self.arn,
                "condition": condition,
                "approximateInvokeCount": calls,
            },
            "requestPayload": _json(self.delivery.put.payload),
        }
        if self.answer is not None:
            record["responseContext"] = {"statusCode": 200, "executedVersion": self.answer.version}
            if not self.ok:
                record["responseContext"]["functionError"] = "Unhandled"
            record["responsePayload"] = _json(self.answer.outcome.payload)
        elif isinstance(self.result, Dead):
            record["responsePayload"] = {"errorType": self.result.code, "errorMessage": self.result.message}
        return record


def ending_puts(ending: Ending, new_id: Callable[[], str]) -> Sequence[Put]:
    """What is put for all who are to be told."""
    settings, delivery = ending.settings, ending.delivery
    hops = int(delivery.put.context.get("hops", 0)) + 1
    found: list[Put] = []
    destination = settings.on_success if ending.ok else settings.on_failure
    if destination and hops <= MOST_HOPS:
        side = "Success" if ending.ok else "Failure"
        facts = {"function": ending.arn, "side": side, "hops": hops}
        dedup = f"{delivery.id}/{delivery.redrives}/{side.lower()}"
        robot = delivery.put.robot
        found.append(destination_put(destination, ending.record(), facts, dedup=dedup, robot=robot, new_id=new_id))
    if settings.dead_letter and isinstance(ending.result, Dead):
        attributes = {
            "RequestID": ending.request_id,
            "ErrorCode": "200",
            "ErrorMessage": ending.result.message[:DLQ_MESSAGE_CHARS],
        }
        found.append(
            Put(
                kind=DESTINATION,
                target=settings.dead_letter,
                payload=delivery.put.payload,
                robot=delivery.put.robot,
                dedup=f"{delivery.id}/{delivery.redrives}/dead",
                context={"function": ending.arn, "side": "Failure", "attributes": attributes},
                policy=POLICY,
            )
        )
    return found


def destination_put(
    arn: str, record: Mapping[str, Any], facts: Mapping[str, Any], *, dedup: str, robot: str, new_id: Callable[[], str]
) -> Put:
    """What is put for one destination; payloads in a record that would be too large are left out of it."""
    payload = orjson.dumps(record)
    for name in ("responsePayload", "requestPayload"):
        if len(payload) > LIMITS.function_event_bytes and name in record:
            size_bytes = len(orjson.dumps(record[name]))
            record = {**record, name: {"omitted": {"reason": "too_large", "size_bytes": size_bytes}}}
            payload = orjson.dumps(record)
    if (own := own_function(arn)) is not None:
        context = {"hops": facts.get("hops", 1)}
        return event_put(*own, payload, request_id=new_id(), dedup=dedup, robot=robot, context=context)
    return Put(
        kind=DESTINATION, target=arn, payload=payload, robot=robot, dedup=dedup, context=dict(facts), policy=POLICY
    )


def own_function(arn: str) -> tuple[str, str] | None:
    """Name and qualifier of a function of this gateway; None for anything else."""
    if not arn.startswith(OWN):
        return None
    return function_of(arn.removeprefix(OWN))


def _json(payload: bytes) -> Any:
    if len(payload) > LIMITS.function_event_bytes:  # no record has room for it: it is not parsed first
        return {"omitted": {"reason": "too_large", "size_bytes": len(payload)}}
    try:
        return orjson.loads(payload)
    except orjson.JSONDecodeError:
        return payload.decode("utf-8", "replace")


def _iso(at_ns: int) -> str:
    """As Lambda writes it: with milliseconds."""
    when = datetime.fromtimestamp(at_ns // 10**9, UTC)
    return f"{when:%Y-%m-%dT%H:%M:%S}.{at_ns % 10**9 // 10**6:03d}Z"
