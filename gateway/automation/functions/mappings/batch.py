"""A batch of an event source mapping: what the function gets, and what its answer means for where to go on. Pure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, Protocol

import orjson

from gateway.automation.functions.directory import MappingRow
from gateway.domain.automation.gateway_event import GatewayEvent
from gateway.domain.automation.shapes import eventbridge
from gateway.store.automation.mapping_cursors import Cursor

__all__ = ["MOST_WAIT_S", "Batch", "Item", "Verdict", "failed_from", "judge", "wanted"]

LEAST_WAIT_S: Final = 1.0
MOST_WAIT_S: Final = 60.0
ANSWER_BYTES: Final = 1 << 20  # 10,000 names of messages have room in it; more is no such answer, and is not parsed


class Matcher(Protocol):
    """What is needed of a compiled pattern."""

    def matches(self, event: Mapping[str, Any]) -> bool:
        """Whether an event fits."""


@dataclass(frozen=True, slots=True)
class Item:
    """One message; `receive_ns` is when the gateway got it."""

    seq: int
    receive_ns: int
    gateway_event: GatewayEvent


@dataclass(frozen=True, slots=True)
class Batch:
    """What was read: the items that are wanted, and the newest number that was looked at; `full`: there may be more."""

    items: Sequence[Item]
    last_seq: int
    full: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """Where the mapping goes on, and after how long; `dropped` items are given up, and told to OnFailure."""

    cursor: Cursor
    wait_s: float = 0.0
    dropped: Sequence[Item] = ()
    why: str = ""


def wanted(item: Item, patterns: Sequence[Matcher], source_arn: str) -> bool:
    """Whether a message passes the mapping's filters: any of them, or there is none."""
    if not patterns:
        return True
    about = {
        "eventSourceARN": source_arn,
        "partitionKey": item.gateway_event.robot,
        "data": eventbridge(item.gateway_event),
    }
    return any(pattern.matches(about) for pattern in patterns)


def failed_from(batch: Sequence[Item], row: MappingRow, *, ok: bool, payload: bytes) -> int | None:
    """The index of the first message that failed; None: all went well.

    Without ReportBatchItemFailures, and where the answer is none of that kind, all went as the call did.
    """
    if not ok:
        return 0
    if not row.report_failures:
        return None
    if len(payload) > ANSWER_BYTES:
        return 0
    try:
        document: Any = orjson.loads(payload) if payload else None
    except orjson.JSONDecodeError:
        return 0
    if document is None or document == {}:
        return None
    failures = document.get("batchItemFailures") if isinstance(document, dict) else 0
    if failures is None:
        return None
    if not isinstance(failures, list):
        return 0
    places = {item.gateway_event.id: index for index, item in enumerate(batch)}
    names = [failure.get("itemIdentifier") if isinstance(failure, dict) else None for failure in failures]
    if any(not isinstance(name, str) or name not in places for name in names):
        return 0
    return min((places[str(name)] for name in names), default=None)


def judge(batch: Batch, row: MappingRow, cursor: Cursor, *, failed: int | None, now_ns: int) -> Verdict:
    """Where to go on after a call."""
    if failed is None:
        most = cursor.most_seq if cursor.most_seq > batch.last_seq else 0
        return Verdict(cursor=Cursor(batch.last_seq, 0, most))
    rest = batch.items[failed:]
    if failed:  # what went well is done with; what follows begins its own tries
        cursor = Cursor(rest[0].seq - 1, 0, cursor.most_seq)
    if row.bisect and len(rest) > 1 and not failed:
        return Verdict(cursor=replace(cursor, most_seq=rest[len(rest) // 2 - 1].seq))
    tries = cursor.tries + 1
    if 0 <= row.most_retries < tries:
        return Verdict(cursor=_past(batch, cursor), dropped=rest, why="RetryAttemptsExhausted")
    old = sum(_is_old(item, row, now_ns) for item in rest)  # the oldest come first
    if old:
        beyond = _past(batch, cursor) if old == len(rest) else Cursor(rest[old - 1].seq, 0, cursor.most_seq)
        return Verdict(cursor=beyond, dropped=rest[:old], why="EventAgeExceeded")
    wait_s = min(MOST_WAIT_S, LEAST_WAIT_S * 2 ** min(tries - 1, 10))
    return Verdict(cursor=replace(cursor, tries=tries), wait_s=wait_s)


def _past(batch: Batch, cursor: Cursor) -> Cursor:
    return Cursor(batch.last_seq, 0, cursor.most_seq if cursor.most_seq > batch.last_seq else 0)


def _is_old(item: Item, row: MappingRow, now_ns: int) -> bool:
    return 0 <= row.most_age_s < (now_ns - item.receive_ns) / 1e9
