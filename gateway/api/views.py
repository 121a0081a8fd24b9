"""Robots, topics and series as the API shows them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any

from gateway.domain.lease import Lease
from gateway.ingest.registry import ChannelState, RobotRecord
from gateway.store.query import SeriesFacts, SeriesRange

__all__ = ["range_view", "rfc3339", "robot_view", "series_view", "topic_view"]


def rfc3339(wall_ns: int) -> str:
    """A wall-clock time in UTC with milliseconds."""
    return datetime.fromtimestamp(wall_ns / 1e9, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")


def robot_view(record: RobotRecord, lease: Lease | None, *, now_s: float) -> dict[str, Any]:
    """A robot with its link, counts and newest values."""
    counts, statistics = record.counts, record.statistics
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
        "link": {
            "session": record.session_number,
            "rtt_ms": None if record.rtt_s is None else round(record.rtt_s * 1000, 3),
            "outbox_bytes": statistics.outbox_bytes,
            "outbox_samples": statistics.outbox_samples,
            "bytes_per_s": round(record.byte_rate.read(now_s), 1),
        },
        "channels": len(record.channels),
        "counts": {
            "samples": counts.samples,
            "bytes": counts.bytes,
            "duplicates": counts.duplicates,
            "gaps": counts.gaps,
            "lost": counts.lost,
        },
        "lease": None
        if lease is None
        else {"holder": lease.holder, "expires_in_s": round(lease.expires_in_s(now_s), 3)},
        "latest": latest,
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
        "publishers": rate.publishers,
        "subscribers": rate.subscribers,
        "received": state.received,
        "received_bytes": state.received_bytes,
        "lost": state.lost,
        "last_stamp_ms": None if state.last_stamp_ns is None else state.last_stamp_ns / 1e6,
        "demand_hz": demand.get(channel.topic),
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
