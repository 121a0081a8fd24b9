"""Messages page by page: a bounded number of them, and of bytes, and where the next page begins."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from gateway.domain.decoder import Decoder
from gateway.history.cursor import write_cursor
from gateway.history.losses import Loss
from gateway.history.messages import Message, MessageKey
from gateway.history.scan import Scan
from gateway.history.source import Source
from metaros.limits import LIMITS

__all__ = ["Page", "PageRequest", "message_facts", "read_page"]

HOLD_BYTES = 16 << 20


@dataclass(frozen=True, slots=True, kw_only=True)
class PageRequest:
    """What is asked; `after` is where the page before ended."""

    robot_id: str
    topics: tuple[str, ...]
    start_ns: int
    end_ns: int
    limit: int
    newest_first: bool = False
    after: MessageKey | None = None


@dataclass(frozen=True, slots=True)
class Page:
    """Messages, what of them could not be read, and the cursor of the next page, if there may be one."""

    messages: list[Message]
    losses: Sequence[Loss]
    next: str | None


def read_page(source: Source, request: PageRequest) -> Page:
    """The next messages in order; a page has one at least, however large it is."""
    after, newest_first = request.after, request.newest_first
    start_ns, end_ns = request.start_ns, request.end_ns
    if after is not None:
        start_ns, end_ns = (start_ns, min(end_ns, after[0])) if newest_first else (max(start_ns, after[0]), end_ns)
    scan = Scan(
        source=source,
        robot_id=request.robot_id,
        topics=request.topics,
        start_ns=start_ns,
        end_ns=end_ns,
        newest_first=newest_first,
        hold_bytes=HOLD_BYTES,
    )
    found: list[Message] = []
    size_bytes = 0
    for message in scan.messages():
        if after is not None and (message.place >= after if newest_first else message.place <= after):
            continue
        full = len(found) >= request.limit or size_bytes + len(message.payload) > LIMITS.history_page_bytes
        if found and full:
            return Page(found, scan.losses, write_cursor(found[-1].place, newest_first=newest_first))
        found.append(message)
        size_bytes += len(message.payload)
    return Page(found, scan.losses, None)


def message_facts(message: Message, decoder: Decoder | None) -> dict[str, Any]:
    """A message as an answer holds it: decoded, or without a decoder as base64."""
    channel = message.channel
    facts: dict[str, Any] = {
        "topic": channel.topic,
        "type": channel.schema_name,
        "stamp_ns": message.stamp_ns,
        "stamp_ms": message.stamp_ns / 1e6,
        "seq": message.seq,
        "epoch": f"{message.epoch:016x}",
        "class": channel.delivery,
    }
    if decoder is not None:
        return {**facts, **decoder.view(channel, message.payload)}
    return {**facts, "cdr": base64.b64encode(message.payload).decode()}
