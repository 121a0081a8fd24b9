"""Functions as the API shows them: made of what the catalogue answers in AWS's words."""

from __future__ import annotations

import platform
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import orjson

from gateway.api.views.robots import rfc3339
from gateway.automation.functions.directory import EventInvoke, MappingRow
from gateway.automation.functions.invoker import Invoked
from gateway.automation.functions.logs import LogLine
from gateway.automation.functions.meters import Stats
from gateway.domain.automation.canary import Canary
from gateway.domain.automation.delivery import Delivery
from gateway.domain.automation.invocation import Recorded
from metaros.automation.functions.calls import Outcome

__all__ = [
    "alias_view",
    "canary_view",
    "dead_letter_view",
    "event_view",
    "function_view",
    "invocation_view",
    "invoked_view",
    "line_view",
    "mapping_view",
    "stats_view",
    "version_view",
]

Document = Mapping[str, Any]
TIMED_OUT = "Sandbox.Timeout"


def function_view(settings: Document, *, versions: int, aliases: Sequence[Document]) -> dict[str, Any]:
    """What `GetFunctionConfiguration` says of `$LATEST`."""
    return {
        "name": settings["FunctionName"],
        "arn": settings["FunctionArn"],
        "description": settings.get("Description", ""),
        "runtime": settings["Runtime"],
        "interpreter": f"python{platform.python_version()}",
        "handler": settings["Handler"],
        "state": settings.get("State", "Active"),
        "reason": settings.get("StateReason", ""),
        "timeout_s": settings["Timeout"],
        "memory_mb": settings["MemorySize"],
        "disk_mb": settings.get("EphemeralStorage", {}).get("Size", 512),
        "code_sha256": settings["CodeSha256"],
        "code_bytes": settings["CodeSize"],
        "modified": settings["LastModified"],
        "versions": versions,
        "aliases": list(aliases),
    }


def alias_view(alias: Document, canary: Canary | None) -> dict[str, Any]:
    """What `ListAliases` says of one."""
    return {
        "name": alias["Name"],
        "version": alias["FunctionVersion"],
        "description": alias.get("Description", ""),
        "weights": (alias.get("RoutingConfig") or {}).get("AdditionalVersionWeights", {}),
        "canary": canary_view(canary) if canary is not None else None,
    }


def version_view(settings: Document) -> dict[str, Any]:
    """What `ListVersionsByFunction` says of one."""
    return {
        "version": settings["Version"],
        "description": settings.get("Description", ""),
        "code_sha256": settings["CodeSha256"],
        "modified": settings["LastModified"],
    }


def canary_view(canary: Canary) -> dict[str, Any]:
    """A canary, as it is."""
    names = ("version", "stable", "weight", "error_rate", "least_invocations", "for_s", "step", "state", "reason")
    view = {name: getattr(canary, name) for name in (*names, "invocations", "errors")}
    return {**view, "began": rfc3339(canary.began_ns), "changed": rfc3339(canary.changed_ns)}


def event_view(settings: EventInvoke) -> dict[str, Any]:
    """How events are tried."""
    return asdict(settings)


def mapping_view(row: MappingRow, result: str) -> dict[str, Any]:
    """An event source mapping."""
    names = (
        "uuid",
        "qualifier",
        "enabled",
        "batch_size",
        "window_s",
        "most_retries",
        "most_age_s",
        "bisect",
        "report_failures",
        "parallel",
        "on_failure",
    )
    return {**{name: getattr(row, name) for name in names}, "source": row.source_arn, "result": result}


def stats_view(stats: Stats, **now: Any) -> dict[str, Any]:
    """Counts over a window, and those of now."""
    view = {name: getattr(stats, name) for name in Stats.__dataclass_fields__ if name != "series"}
    series = [{**{k: v for k, v in row.items() if k != "at_ns"}, "at": rfc3339(row["at_ns"])} for row in stats.series]
    return {**view, **now, "series": series}


def invocation_view(call: Recorded, *, log: bool) -> dict[str, Any]:
    """A call; its log only for who may see the logs of all robots."""
    view = asdict(call)
    view["began"] = rfc3339(view.pop("began_ns"))
    if not log:
        view["log"] = ""
    return view


def invoked_view(invoked: Invoked) -> dict[str, Any]:
    """What came of a call."""
    outcome = invoked.outcome
    failed = "timeout" if outcome.error_type == TIMED_OUT else "error"
    return {
        "request_id": invoked.request_id,
        "version": invoked.version,
        "status": "ok" if outcome.ok else failed,
        "payload": _payload(outcome),
        "error_type": outcome.error_type,
        "duration_ms": outcome.duration_ms,
        "init_ms": outcome.init_ms,
        "max_memory_mb": outcome.max_memory_mb,
        "log": outcome.log.decode("utf-8", "replace"),
    }


def line_view(line: LogLine) -> dict[str, Any]:
    """A line of a log."""
    return {
        "cursor": line.cursor,
        "at": rfc3339(line.at_ns),
        "request_id": line.request_id,
        "version": line.version,
        "text": line.text,
    }


def dead_letter_view(delivery: Delivery, *, payload_bytes: int | None = None) -> dict[str, Any]:
    """What could not be delivered; with so much of its payload, or without."""
    put = delivery.put
    cut = put.payload[:payload_bytes] if payload_bytes is not None else b""
    return {
        "id": delivery.id,
        "kind": put.kind,
        "target": put.target,
        "happening": put.event_id,
        "robot": put.robot,
        "code": delivery.code,
        "message": delivery.message,
        "attempts": delivery.attempts,
        "tries": delivery.tries,
        "redrives": delivery.redrives,
        "born": rfc3339(delivery.born_ns),
        "ended": rfc3339(delivery.ended_ns),
        "payload": cut.decode("utf-8", "replace") if payload_bytes is not None else None,
        "truncated": payload_bytes is not None and len(put.payload) > payload_bytes,
    }


def _payload(outcome: Outcome) -> Any:
    try:
        return orjson.loads(outcome.payload) if outcome.payload else None
    except orjson.JSONDecodeError:
        return outcome.payload.decode("utf-8", "replace")
