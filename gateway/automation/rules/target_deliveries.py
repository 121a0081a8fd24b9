"""The deliveries of a rule that fires: one for each of its targets."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import orjson

from gateway.automation.rules.rule import Rule, Target
from gateway.automation.rules.target_kinds import target_kind
from gateway.automation.rules.transform import RenderedTooLargeError
from gateway.domain.automation.delivery import Policy, Put
from gateway.domain.automation.gateway_event import GatewayEvent
from gateway.domain.automation.shapes import SHAPES
from gateway.domain.fleet.command import new_command_id
from metaros.limits import LIMITS, Limits

__all__ = ["Firing", "FunctionCall", "FunctionPut", "no_functions", "payload_of", "target_deliveries"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Firing:
    """A rule fired on an event. `by_timer_ns` is when the timer was due that fired, 0 where the event itself
    did; `ended` says that what had fired is over.
    """

    rule: Rule
    gateway_event: GatewayEvent
    group: str
    now_ns: int
    by_timer_ns: int = 0
    ended: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class FunctionCall:
    """A function that a rule calls."""

    name: str
    qualifier: str
    payload: bytes
    request_id: str
    robot: str
    event_id: str
    dedup: str
    policy: Policy
    context: Mapping[str, Any] = field(default_factory=dict)


FunctionPut = Callable[[FunctionCall], Put]


def no_functions(call: FunctionCall) -> Put:
    """Of a gateway that has none: it waits in the queue until one does."""
    return Put(
        kind="function",
        target=f"{call.name}:{call.qualifier}" if call.qualifier else call.name,
        payload=call.payload,
        event_id=call.event_id,
        robot=call.robot,
        dedup=call.dedup,
        context={**call.context, "request_id": call.request_id},
        policy=call.policy,
    )


def target_deliveries(
    firing: Firing, function_put: FunctionPut = no_functions, *, limits: Limits = LIMITS
) -> list[Put]:
    """A delivery for each target; of an end only for those that an end concerns.

    Raises:
        ValueError: the event has not the shape that the rule wants, or is about no robot where a target needs one.
    """
    rule = firing.rule
    wanted = [target for target in rule.targets if target.kind == "alert" or not firing.ended]
    if not wanted:
        return []
    event = SHAPES[rule.event_format](firing.gateway_event)
    return [_put(firing, target, event, function_put, limits) for target in wanted]


def payload_of(rule: Rule, target: Target, event: Mapping[str, Any], *, limits: Limits = LIMITS) -> bytes:
    """What a target gets of an event in its rule's shape; of one that is too large what it is about."""
    most_bytes = limits.rule_payload_bytes
    try:
        payload = orjson.dumps(target.transform.render(event, rule.name, most_bytes=most_bytes))
        if len(payload) <= most_bytes:
            return payload
        size_bytes = len(payload)
    except RenderedTooLargeError:
        size_bytes = most_bytes + 1  # at least
    known = {key: value for key, value in event.items() if isinstance(value, str | int | float) and key != "data"}
    return orjson.dumps({**known, "omitted": {"reason": "too_large", "size_bytes": size_bytes}})


def _put(firing: Firing, target: Target, event: Mapping[str, Any], function_put: FunctionPut, limits: Limits) -> Put:
    rule, gateway_event = firing.rule, firing.gateway_event
    robot = target.fields.get("robot") or gateway_event.robot
    if target_kind(target.kind, "kind").robot and not robot:
        raise ValueError(f"target {target.id} needs a robot, and the event is about none")
    payload = payload_of(rule, target, event, limits=limits)
    context = {
        "rule": rule.name,
        "revision": rule.revision,
        "target": target.id,
        "fields": dict(target.fields),
        "maker": asdict(rule.maker),
        "ended": firing.ended,
        "group": firing.group,
    }
    if target.kind == "function":
        return function_put(
            FunctionCall(
                name=target.fields["function"],
                qualifier=target.fields.get("qualifier", ""),
                payload=payload,
                request_id=new_command_id(firing.now_ns),
                robot=robot,
                event_id=gateway_event.id,
                dedup=_dedup(firing, target),
                policy=target.policy,
                context={"rule": rule.name, "target": target.id},
            )
        )
    return Put(
        kind=target.kind,
        target=f"{rule.name}/{target.id}",
        payload=payload,
        event_id=gateway_event.id,
        robot=robot,
        dedup=_dedup(firing, target),
        context=context,
        policy=target.policy,
    )


def _dedup(firing: Firing, target: Target) -> str:
    """Of the same rule, target and event there is one, and one more for each timer and each end."""
    parts = (firing.rule.name, target.id, firing.gateway_event.source, firing.gateway_event.id, firing.group)
    text = "\0".join((*parts, str(firing.by_timer_ns), str(int(firing.ended))))
    return hashlib.blake2b(text.encode(errors="replace"), digest_size=15).hexdigest()
