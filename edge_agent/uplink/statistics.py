"""Statistics of topics and of the link for the gateway, once a second while there is news."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from edge_agent.outbox import Outbox
from metaros._proto import link_pb2
from metaros.link import ClockOffset

if TYPE_CHECKING:
    from edge_agent.uplink.queues import Queues

__all__ = ["LinkFacts", "statistics", "steady_part"]

MOST_NS = 2**63 - 1  # whatever clock a gateway has


@dataclass(slots=True)
class LinkFacts:
    """What only the shell around the sessions knows."""

    transport: str = ""
    gateway: str = ""
    reconnects: int = 0
    black_box: Callable[[], link_pb2.BlackBox] | None = None


def statistics(
    queues: Queues, facts: LinkFacts, offset: ClockOffset, *, now_s: float, malformed: int
) -> link_pb2.TopicStatistics:
    """The frame of one second."""
    depths = [class_depth(queues.outbox, name) for name in ("event", "metric", "bulk")]
    live = link_pb2.ClassDepth(
        name="live",
        fresh_bytes=queues.live.size_bytes,
        samples=len(queues.live),
        lost=queues.live.dropped,
        quota_bytes=queues.live.max_bytes,
    )
    link = link_pb2.LinkStatistics(
        transport=facts.transport,
        gateway=facts.gateway,
        budget_bytes_per_s=queues.budget.limit_bytes_per_s,
        sent_bytes_per_s=queues.budget.sent_bytes_per_s,
        reconnects=facts.reconnects,
        classes=[*depths, live],
        disk_free_bytes=queues.outbox.free_bytes,
        clock_offset_ns=min(max(offset.offset_ns() or 0, -MOST_NS), MOST_NS),
        black_box=facts.black_box() if facts.black_box is not None else None,
    )
    return link_pb2.TopicStatistics(
        topics=[channel.rate(now_s) for channel in queues.channels],
        outbox_bytes=sum(depth.fresh_bytes + depth.backfill_bytes for depth in depths),
        outbox_samples=sum(depth.samples for depth in depths),
        malformed=malformed,
        link=link,
    )


def steady_part(frame: link_pb2.TopicStatistics) -> link_pb2.TopicStatistics:
    """What stays the same on a robot on which nothing happens: statistics that differ only in the rest are no news."""
    part = link_pb2.TopicStatistics()
    part.CopyFrom(frame)
    part.link.ClearField("sent_bytes_per_s")
    part.link.ClearField("disk_free_bytes")
    part.link.ClearField("clock_offset_ns")
    return part


def class_depth(outbox: Outbox, name: str) -> link_pb2.ClassDepth:
    """How much of a durable class waits."""
    depth = outbox.depth(name)
    return link_pb2.ClassDepth(
        name=name,
        fresh_bytes=depth.fresh_bytes,
        backfill_bytes=depth.backfill_bytes,
        samples=depth.samples,
        lost=outbox.lost[name],
        disk_bytes=depth.disk_bytes,
        quota_bytes=outbox.quota_bytes(name),
    )
