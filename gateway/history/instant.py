"""An instant: of each topic the newest stored message at or before it, as a viewer of the live stream would have it."""

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
from gateway.history.losses import Loss, loss_view
from gateway.history.messages import Message
from gateway.history.source import Source, loss_reason
from gateway.store.samples import StoredBatch, StoredRun
from metaros.limits import LIMITS

__all__ = ["Instant", "Missing", "instant_facts", "pack_instant", "read_instant"]

_LENGTH = struct.Struct("<I")


@dataclass(frozen=True, slots=True)
class Missing:
    """A topic without a message to show: `reason` is not_stored, too_old, damaged, purged or too_large."""

    topic: str
    reason: str
    nearest_ns: int | None = None


@dataclass(slots=True)
class Instant:
    """What there is at `t_ns`."""

    t_ns: int
    messages: list[Message] = field(default_factory=list)
    missing: list[Missing] = field(default_factory=list)
    losses: Sequence[Loss] = ()


def read_instant(source: Source, robot_id: str, topics: Sequence[str], *, t_ns: int, max_age_ns: int) -> Instant:
    """Each topic's newest message at or before `t_ns`; of a latched topic at any age, else no older than that."""
    instant = Instant(t_ns)
    size_bytes = 0
    for topic in topics:
        try:
            run = source.newest(robot_id, topic, t_ns)
            message = None if run is None else _last_by(source.load(run), run, t_ns)
        except (DamagedError, PurgedError) as error:
            instant.missing.append(Missing(topic, loss_reason(error)))
            continue
        if message is None:
            instant.missing.append(Missing(topic, "not_stored"))
        elif message.stamp_ns < t_ns - max_age_ns and not is_latched(message.channel.qos):
            instant.missing.append(Missing(topic, "too_old", message.stamp_ns))
        elif size_bytes + len(message.payload) > LIMITS.history_instant_bytes:
            instant.missing.append(Missing(topic, "too_large", message.stamp_ns))
        else:
            instant.messages.append(message)
            size_bytes += len(message.payload)
    instant.losses = source.losses(robot_id, start_ns=t_ns - max_age_ns, end_ns=t_ns)
    return instant


def pack_instant(instant: Instant) -> bytes:
    """The length of a JSON text, the text, and a frame of records as the stream sends them; channels from 1 on."""
    parts: list[bytes] = []
    for number, message in enumerate(instant.messages, 1):
        record = Record(message.seq, message.stamp_ns, message.receive_ns, message.payload)
        parts += record_parts(record, subscription=0, channel=number)
    channels = [introduction(message.channel, number) for number, message in enumerate(instant.messages, 1)]
    text = orjson.dumps({**instant_facts(instant), "channels": channels})
    return b"".join((_LENGTH.pack(len(text)), text, *parts))


def instant_facts(instant: Instant) -> dict[str, Any]:
    """What every format of the answer says."""
    return {
        "t_ms": instant.t_ns / 1e6,
        "missing": [
            {
                "topic": item.topic,
                "reason": item.reason,
                "nearest_ms": None if item.nearest_ns is None else item.nearest_ns / 1e6,
            }
            for item in instant.missing
        ],
        "gaps": [loss_view(loss) for loss in instant.losses],
    }


def _last_by(batch: StoredBatch, run: StoredRun, t_ns: int) -> Message | None:
    """A run's newest message at or before `t_ns`."""
    order = np.argsort(batch.stamps_ns, kind="stable")
    fitting = order[batch.stamps_ns[order] <= t_ns]
    if not len(fitting):
        return None
    index = int(fitting[-1])
    end = int(np.sum(batch.lengths[: index + 1], dtype=np.int64))
    payload = batch.payload[end - int(batch.lengths[index]) : end]
    stamp_ns, seq = int(batch.stamps_ns[index]), run.first_seq + index
    return Message(batch.channel, run.stream_id, run.epoch, seq, stamp_ns, batch.receive_ns, payload)
