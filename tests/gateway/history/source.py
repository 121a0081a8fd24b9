"""A source for tests: the store's own reading, on the connection and the thread of the test."""

from __future__ import annotations

from collections.abc import Sequence

from gateway.history.losses import Loss
from gateway.store.engine import StoreEngine
from gateway.store.history import StoredTopic, find_runs, gaps_between, newest_candidates, stored_topics
from gateway.store.load import RunLoader
from gateway.store.samples import SampleFilter, StoredBatch, StoredRun

__all__ = ["EngineSource"]


class EngineSource:
    """`gateway.history.source.Source` over an engine; counts what it loads."""

    def __init__(self, engine: StoreEngine) -> None:
        self.engine = engine
        self.loads = 0
        self._loader = RunLoader()

    def topics(self, robot_id: str) -> Sequence[StoredTopic]:
        return stored_topics(self.engine, robot_id)

    def runs(self, robot_id: str, wanted: SampleFilter, *, newest_first: bool, limit: int) -> Sequence[StoredRun]:
        return find_runs(self.engine, robot_id, wanted, limit=limit, newest_first=newest_first)

    def load(self, run: StoredRun) -> StoredBatch:
        self.loads += 1
        return self._loader.load(self.engine, run)

    def newest(self, robot_id: str, topic: str, t_ns: int) -> StoredRun | None:
        return self._loader.newest(self.engine, newest_candidates(self.engine, robot_id, topic, t_ns), t_ns)

    def losses(self, robot_id: str, *, start_ns: int, end_ns: int) -> Sequence[Loss]:
        found = gaps_between(self.engine, robot_id, start_ns=start_ns, end_ns=end_ns, limit=1000)
        return [
            Loss(
                from_ns=item.gap.from_ns,
                to_ns=item.gap.to_ns,
                count=item.gap.count,
                reason=item.gap.reason,
                topic=item.topic or None,
            )
            for item in found
        ]
