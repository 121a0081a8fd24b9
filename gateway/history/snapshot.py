"""A snapshot at a time: each topic's newest stored message at or before it, as a live viewer would have had it."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import orjson

from gateway.domain.qos import is_latched
from gateway.domain.records import Record, introduction, record_parts
from gateway.errors import DamagedError, PurgedError
from gateway.history.losses import Loss, loss_view, merged_losses
from gateway.history.messages import Message
from gateway.history.source import Newest, Source, loss_reason
from metaros.limits import LIMITS

__all__ = ["Missing", "Snapshot", "pack_snapshot", "read_snapshot", "snapshot_facts"]

TOGETHER = 8  # topics that are read at a time: what is loaded of them is many times what is shown
_LENGTH = struct.Struct("<I")


@dataclass(frozen=True, slots=True)
class Missing:
    """A topic without a message to show: `reason` is not_stored, too_old, damaged, purged or too_large."""

    topic: str
    reason: str
    nearest_ns: int | None = None


@dataclass(slots=True)
class Snapshot:
    """What there is at `t_ns`."""

    t_ns: int
    messages: list[Message] = field(default_factory=list)
    missing: list[Missing] = field(default_factory=list)
    losses: Sequence[Loss] = ()


def read_snapshot(source: Source, robot_id: str, topics: Sequence[str], *, t_ns: int, max_age_ns: int) -> Snapshot:
    """Each topic's newest message at or before `t_ns`; of a latched topic at any age, else no older than that."""
    snapshot = Snapshot(t_ns)
    left_bytes = LIMITS.history_instant_bytes
    for first in range(0, len(topics), TOGETHER):
        some = topics[first : first + TOGETHER]
        for topic, newest in zip(some, source.newest(robot_id, some, t_ns), strict=True):
            found = _message(newest, t_ns)
            if isinstance(found, str):
                snapshot.missing.append(Missing(topic, found))
            elif found.stamp_ns < t_ns - max_age_ns and not is_latched(found.channel.qos):
                snapshot.missing.append(Missing(topic, "too_old", found.stamp_ns))
            elif len(found.payload) > left_bytes:
                snapshot.missing.append(Missing(topic, "too_large", found.stamp_ns))
            else:
                snapshot.messages.append(found)
                left_bytes -= len(found.payload)
    losses = source.losses(robot_id, start_ns=t_ns - max_age_ns, end_ns=t_ns)
    snapshot.losses = merged_losses(loss for loss in losses if loss.topic in topics)
    return snapshot


def pack_snapshot(snapshot: Snapshot) -> bytes:
    """The length of a JSON text, the text, and a frame of records as the stream sends them; channels from 1 on."""
    parts: list[bytes] = []
    for number, message in enumerate(snapshot.messages, 1):
        record = Record(message.seq, message.stamp_ns, message.receive_ns, message.payload)
        parts += record_parts([record], subscription=0, channel=number)
    channels = [introduction(message.channel, number) for number, message in enumerate(snapshot.messages, 1)]
    text = orjson.dumps({**snapshot_facts(snapshot), "channels": channels})
    return b"".join((_LENGTH.pack(len(text)), text, *parts))


def snapshot_facts(snapshot: Snapshot) -> dict[str, Any]:
    """What every format of the answer says."""
    return {
        "t_ms": snapshot.t_ns / 1e6,
        "missing": [
            {
                "topic": item.topic,
                "reason": item.reason,
                "nearest_ms": None if item.nearest_ns is None else item.nearest_ns / 1e6,
            }
            for item in snapshot.missing
        ],
        "gaps": [loss_view(loss) for loss in snapshot.losses],
    }


def _message(newest: Newest, t_ns: int) -> Message | str:
    """The newest message at or before `t_ns`, or why there is none."""
    if newest is None:
        return "not_stored"
    if isinstance(newest, (DamagedError, PurgedError)):
        return loss_reason(newest)
    order = np.argsort(newest.stamps_ns, kind="stable")
    fitting = order[newest.stamps_ns[order] <= t_ns]
    if not len(fitting):
        return "not_stored"
    index = int(fitting[-1])
    end = int(np.sum(newest.lengths[: index + 1], dtype=np.int64))
    payload = newest.payload[end - int(newest.lengths[index]) : end]
    stamp_ns, seq = int(newest.stamps_ns[index]), newest.first_seq + index
    return Message(newest.channel, newest.stream_id, newest.epoch, seq, stamp_ns, newest.receive_ns, payload)
