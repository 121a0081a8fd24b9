"""Robots, topics and series as the API shows them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

from gateway.domain.channel import METRIC_STREAM
from gateway.domain.fleet.lease import Lease
from gateway.domain.fleet.recording import plain_time
from gateway.domain.sample import Gap
from gateway.ingest.registry import ChannelState, RobotRecord
from gateway.store.telemetry.query import SeriesFacts, StoredGap
from gateway.store.telemetry.series import DAMAGED, SeriesRange
from metaros._proto import link_pb2
from metaros.link import BACKFILL_BIT, CHANNEL_MASK

__all__ = [
    "gap_view",
    "metric_gaps_view",
    "range_view",
    "rfc3339",
    "robot_view",
    "series_view",
    "topic_view",
    "uplink_view",
]

NO_ALERTS: Mapping[str, int] = {"open": 0, "error": 0, "warning": 0}
_MAX_CLASSES = 8  # of what an agent tells
_DEPTH_FIELDS = ("name", "fresh_bytes", "backfill_bytes", "samples", "lost", "disk_bytes", "quota_bytes")


def rfc3339(wall_ns: int) -> str:
    """A wall-clock time in UTC with milliseconds."""
    return datetime.fromtimestamp(wall_ns / 1e9, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")


def robot_view(
    record: RobotRecord, lease: Lease | None, *, now_s: float, alerts: Mapping[str, int] = NO_ALERTS
) -> dict[str, Any]:
    """A robot with its link, counts, newest values, and how many alerts it has."""
    counts = record.shown_counts
    latest = {name: {"stamp_ms": stamp / 1e6, "value": value} for name, (stamp, value) in record.headline().items()}
    return {
        "id": record.robot.id,
        "namespace": record.robot.namespace,
        "hostname": record.robot.hostname,
        "state": "online" if record.online else "offline",
        "since": rfc3339(record.since_ns),
        "last_seen": rfc3339(record.last_seen_ns),
        "agent_version": record.robot.agent_version,
        "labels": dict(record.robot.labels),
        "link": link_view(record, now_s=now_s),
        "channels": record.listed(),
        "counts": {
            "samples": counts.samples,
            "bytes": counts.bytes,
            "duplicates": counts.duplicates,
            "gaps": counts.gaps,
            "lost": counts.lost,
            "over_quota": counts.over_quota,
            "put_off": counts.put_off,
        },
        "lease": None
        if lease is None
        else {"holder": lease.holder, "expires_in_s": round(lease.expires_in_s(now_s), 3)},
        "latest": latest,
        "alerts": dict(alerts),
    }


def link_view(record: RobotRecord, *, now_s: float) -> dict[str, Any]:
    """A robot's connection, as the gateway measures it and as the agent last told."""
    statistics, told = record.statistics, record.statistics.link
    return {
        "session": record.session_number,
        "rtt_ms": None if record.rtt_s is None else round(record.rtt_s * 1000, 3),
        "outbox_bytes": statistics.outbox_bytes,
        "outbox_samples": statistics.outbox_samples,
        "bytes_per_s": round(record.byte_rate.read(now_s), 1),
        "transport": told.transport,
        "gateway": told.gateway,
        "budget_bytes_per_s": told.budget_bytes_per_s or None,
        "sent_bytes_per_s": round(told.sent_bytes_per_s, 1),
        "reconnects": told.reconnects,
        "classes": [{name: getattr(depth, name) for name in _DEPTH_FIELDS} for depth in told.classes[:_MAX_CLASSES]],
        "disk_free_bytes": told.disk_free_bytes,
        "clock_offset_ms": round(told.clock_offset_ns / 1e6, 3),
        "forks": record.forks,
        "epochs": record.epochs,
        "black_box": black_box_view(told.black_box),
    }


def black_box_view(told: link_pb2.BlackBox) -> dict[str, Any] | None:
    """What the robot could still save; None where it keeps no black box."""
    if not told.quota_bytes:
        return None
    first_ns, last_ns = plain_time(told.from_ns), plain_time(told.to_ns)
    return {
        "from": rfc3339(first_ns) if first_ns else None,
        "to": rfc3339(last_ns) if last_ns else None,
        "size_bytes": told.size_bytes,
        "quota_bytes": told.quota_bytes,
        "lost": told.lost,
    }


def uplink_view(record: RobotRecord) -> dict[str, Any]:
    """A robot's byte budget."""
    told = record.statistics.link
    return {"bytes_per_s": told.budget_bytes_per_s or None, "sent_bytes_per_s": round(told.sent_bytes_per_s, 1)}


def gap_view(record: RobotRecord, stored: StoredGap) -> dict[str, Any]:
    """A declared loss; topic and class are null where the agent has not announced the channel since."""
    gap, number = stored.gap, stored.stream_id & CHANNEL_MASK
    state = record.channels.get(number)
    metric = number == METRIC_STREAM
    return {
        "topic": state.channel.topic if state is not None and not metric else None,
        "class": "metric" if metric else state.channel.delivery if state is not None else None,
        "stream": stored.stream_id,
        "backfill": bool(stored.stream_id & BACKFILL_BIT),
        "epoch": f"{stored.epoch:016x}",
        "from": gap.from_seq,
        "to": gap.to_seq,
        "count": gap.count,
        "reason": gap.reason,
        "lost_from": rfc3339(gap.from_ns) if gap.from_ns else None,
        "lost_to": rfc3339(gap.to_ns) if gap.to_ns else None,
        "declared": rfc3339(stored.stored_ns),
    }


def topic_view(state: ChannelState, demand: Mapping[str, float]) -> dict[str, Any]:
    """A topic: what the robot sees of it and what came of it."""
    channel, rate = state.channel, state.rate
    return {
        "channel": channel.channel_id,
        "topic": channel.topic,
        "type": channel.schema_name,
        "type_hash": channel.type_hash,
        "encoding": channel.encoding,
        "class": channel.delivery,
        "forward": channel.forward,
        "qos": channel.qos,
        "rate_hz": rate.rate_hz,
        "bytes_per_s": rate.bytes_per_s,
        "messages": rate.messages,
        "dropped": rate.dropped,
        "thinned": rate.thinned,
        "publishers": rate.publishers,
        "subscribers": rate.subscribers,
        "received": state.received,
        "received_bytes": state.received_bytes,
        "lost": state.lost,
        "last_stamp_ms": None if state.last_stamp_ns is None else state.last_stamp_ns / 1e6,
        "demand_hz": demand.get(channel.topic),
        "history_hz": channel.history_rate_hz,
    }


def series_view(facts: SeriesFacts) -> dict[str, Any]:
    """A series and its newest row; a value that is no number is null."""
    latest = None
    if facts.stamp_ns is not None and facts.value is not None:
        value = facts.value if math.isfinite(facts.value) else None
        latest = {"stamp_ms": facts.stamp_ns / 1e6, "value": value}
    series = facts.series
    return {
        "name": series.name,
        "topic": series.topic,
        "field": series.field,
        "samples": facts.samples,
        "latest": latest,
    }


def range_view(piece: SeriesRange) -> dict[str, Any]:
    """A piece of a series as columns."""
    return {
        "name": piece.name,
        "stamp_ms": piece.stamp_ms,
        "mean": piece.mean,
        "min": piece.min,
        "max": piece.max,
        "count": piece.count,
    }


def metric_gaps_view(gaps: Sequence[Gap], pieces: Sequence[SeriesRange]) -> list[list[Any]]:
    """Declared losses, and rows that are stored and cannot be read, by time: [from_ms, to_ms, count, reason]."""
    lost = [[gap.from_ns / 1e6, gap.to_ns / 1e6, gap.count, gap.reason] for gap in gaps]
    damaged = [span for piece in pieces for span in piece.damaged]
    return sorted([*lost, *([first / 1e6, last / 1e6, count, DAMAGED] for first, last, count in damaged)])
