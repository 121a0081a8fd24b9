"""Gaps without times of their own: they lie between what is stored before and after them."""

from __future__ import annotations

from gateway.domain.sample import Gap
from gateway.store.engine import Row, StoreEngine, unsigned
from gateway.store.telemetry.history import TopicGap

__all__ = ["undated_gaps"]

_FIND = (
    "SELECT robot, stream_id, epoch, from_seq, to_seq, reason, stored_ns FROM gaps"
    " WHERE robot = (SELECT robot FROM robots WHERE id = ?) AND to_ns = 0 ORDER BY stored_ns DESC, from_seq LIMIT ?"
)
_NEAR = (
    "SELECT b.first_seq, b.first_ns, b.last_ns, c.topic, c.class FROM {table} b"
    " JOIN channels c ON c.channel = b.channel WHERE b.robot = ? AND b.stream_id = ? AND b.epoch = ?"
    " AND b.first_seq {side} ? ORDER BY b.first_seq {order} LIMIT 1"
)
_BEFORE, _AFTER = (
    tuple(_NEAR.format(table=table, side=side, order=order) for table in ("sample_batches", "segment_runs"))
    for side, order in (("<", "DESC"), (">", "ASC"))
)


def undated_gaps(engine: StoreEngine, robot_id: str, *, start_ns: int, end_ns: int, limit: int) -> list[TopicGap]:
    """Those that can lie between two stamps, of the newest `limit`; their times are what is known about them.

    A loss is no older than the sample stored before it, and no newer than the one after it; without one, than the
    moment when it was declared.
    """
    with engine.transaction(write=False):
        found = [_dated(engine, row) for row in engine.fetch(_FIND, robot_id, limit)]
    return [item for item in found if item.gap.to_ns >= start_ns and item.gap.from_ns <= end_ns]


def _dated(engine: StoreEngine, row: Row) -> TopicGap:
    robot, stream_id, epoch, from_seq, to_seq, reason, stored_ns = row
    stream = (robot, stream_id, epoch)
    before = max((near for query in _BEFORE for near in engine.fetch(query, *stream, from_seq)), default=None, key=_seq)
    after = min((near for query in _AFTER for near in engine.fetch(query, *stream, to_seq)), default=None, key=_seq)
    to_ns = stored_ns if after is None else after[1]
    from_ns = min(to_ns, before[2]) if before is not None else to_ns
    topic, delivery = (before or after or ("", "", "", "", ""))[3:5]
    return TopicGap(
        stream_id, unsigned(epoch), Gap(from_seq, to_seq, reason, from_ns, to_ns), stored_ns, topic, delivery
    )


def _seq(near: Row) -> int:
    return int(near[0])
