"""An event for a function as the queue keeps it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from gateway.automation.functions.directory import EventInvoke
from gateway.domain.automation.delivery import Policy, Put

__all__ = ["FUNCTION", "event_put", "function_of", "target_of"]

FUNCTION = "function"  # the kind
WITHOUT = EventInvoke()


def event_put(
    name: str,
    qualifier: str,
    payload: bytes,
    *,
    request_id: str,
    settings: EventInvoke = WITHOUT,
    client_context: str = "",
    trace_id: str = "",
    robot: str = "",
    event_id: str = "",
    dedup: str = "",
    context: Mapping[str, Any] | None = None,
    policy: Policy | None = None,
) -> Put:
    """What is put for an event; when it is delivered, the function's settings of then count.

    `policy` is what the `settings` mean, unless another is given.
    """
    call = {"request": request_id, "client_context": client_context, "trace": trace_id}
    return Put(
        kind=FUNCTION,
        target=target_of(name, qualifier),
        payload=payload,
        robot=robot,
        event_id=event_id,
        dedup=dedup,
        context={**(context or {}), **{key: value for key, value in call.items() if value}},
        policy=policy
        or Policy(most_attempts=1 + settings.most_retries, most_age_s=settings.most_age_s, backoff="lambda"),
    )


def target_of(name: str, qualifier: str) -> str:
    """The queue's target of a function's version or alias."""
    return f"{name}:{qualifier}" if qualifier and qualifier != "$LATEST" else name


def function_of(target: str) -> tuple[str, str]:
    """Name and qualifier of a target."""
    name, _, qualifier = target.partition(":")
    return name, qualifier
