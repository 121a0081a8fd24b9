"""What is told of a robot, and when."""

from __future__ import annotations

from gateway.cluster.mirror.deltas import DETAILS_S, SentSchemas, SentState, delta_of, first_snapshot_of
from gateway.domain.robot import Robot
from gateway.ingest.registry import RobotRecord
from metaros._proto import link_pb2


def test_statistics_that_came_too_soon_after_others_are_reported_a_little_later() -> None:
    record, reported, schemas = RobotRecord(Robot("r1"), seen_ns=1), SentState(), SentSchemas()
    list(first_snapshot_of(record, reported, schemas, now_s=10.0))
    record.report(link_pb2.TopicStatistics(outbox_bytes=9))

    def looked(now_s: float) -> list[int]:
        pieces = [
            piece
            for piece, _ in delta_of(record, reported, schemas, values={}, now_s=now_s, announced=False, look=True)
        ]
        return [piece.statistics.outbox_bytes for piece in pieces if piece.HasField("statistics")]

    assert looked(10.0 + DETAILS_S / 2) == []
    assert looked(10.0 + DETAILS_S) == [9]
    assert looked(10.0 + 3 * DETAILS_S) == []
