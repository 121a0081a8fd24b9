"""Series that nothing on disk names any more are forgotten at start, so that what a robot once had takes no place.

A robot whose topics come and go gathers series; without this, one day its table of series would be full for ever.
"""

from __future__ import annotations

import logging
import struct

from edge_agent.errors import DiskError
from edge_agent.outbox.disk import Disk
from edge_agent.outbox.outbox import Outbox
from edge_agent.outbox.segment import Kind, scan
from metaros._proto import link_pb2
from metaros.limits import LIMITS, Limits

__all__ = ["forget_series"]

LOG = logging.getLogger("metaros.agent.outbox")
METRIC_LOGS = ("metric", "metric_backfill")


def forget_series(outbox: Outbox, disk: Disk, *, limits: Limits = LIMITS) -> int:
    """Forget the series of which no row is held, where half of the table is full; how many.

    Call it before the outbox is used. It reads all metric rows that are held, about a second for a full outbox. Where
    some cannot be read nothing is forgotten: a row that came to light again would name a series that nobody knows.
    """
    known = len(outbox.ids.series)
    if 2 * known <= limits.series_per_robot:
        return 0
    try:
        held = held_series(outbox, disk)
    except DiskError as error:
        LOG.warning("old series are kept, as not all rows can be read: %s", error)
        return 0
    if held is not None:
        outbox.ids.keep_series(held)
    return known - len(outbox.ids.series)


def held_series(outbox: Outbox, disk: Disk) -> set[int] | None:
    """The numbers that rows on disk name; None where something is damaged. Raises DiskError."""
    held: set[int] = set()
    for segment in (segment for name in METRIC_LOGS for segment in outbox.logs[name].segments):
        found = scan(disk.read(segment.name, 0, segment.end), segment.start)
        if found.state != "clean":
            return None
        for frame in found.frames:
            if frame.kind is Kind.METRICS:
                batch = link_pb2.MetricBatch.FromString(frame.body)
                held.update(struct.unpack(f"<{len(batch.series_ids) // 4}I", batch.series_ids))
    return held
