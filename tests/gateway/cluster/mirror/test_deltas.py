"""What is told of a robot, and when."""

from __future__ import annotations

from gateway.cluster.mirror_pieces import DETAILS_S, Schemas, Told, all_news_of, news_of
from gateway.domain.robot import Robot
from gateway.ingest.registry import RobotRecord
from metaros._proto import link_pb2


def test_statistics_that_came_too_soon_after_others_are_told_a_little_later() -> None:
    record, told, schemas = RobotRecord(Robot("r1"), seen_ns=1), Told(), Schemas()
    list(all_news_of(record, told, schemas, now_s=10.0))
    record.report(link_pb2.TopicStatistics(outbox_bytes=9))

    def looked(now_s: float) -> list[int]:
        pieces = [
            piece for piece, _ in news_of(record, told, schemas, values={}, now_s=now_s, announced=False, look=True)
        ]
        return [piece.statistics.outbox_bytes for piece in pieces if piece.HasField("statistics")]

    assert looked(10.0 + DETAILS_S / 2) == []
    assert looked(10.0 + DETAILS_S) == [9]
    assert looked(10.0 + 3 * DETAILS_S) == []
