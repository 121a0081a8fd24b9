"""A source for tests: the store's own reading, on the connection and the thread of the test."""

from __future__ import annotations

from collections.abc import Sequence

from gateway.errors import DamagedError
from gateway.history.losses import Loss
from gateway.history.source import Newest
from gateway.store.engine import StoreEngine
from gateway.store.ledger import in_transaction
from gateway.store.objects import ObjectStore
from gateway.store.telemetry.compact import Compaction
from gateway.store.telemetry.history import find_runs, gaps_between, newest_candidates
from gateway.store.telemetry.load import RunLoader
from gateway.store.telemetry.samples import SampleFilter, StoredBatch, StoredRun
from metaros.clock import SystemClock

__all__ = ["EngineSource", "compact_all"]


def compact_all(engine: StoreEngine, objects: ObjectStore) -> int:
    """Every batch becomes part of a segment, as the gateway's compaction makes it; how many segments there are then."""
    work = Compaction(engine, in_transaction(engine), objects, clock=SystemClock())
    while any(work.compact(due) for due in work.due(everything=True)):
        pass
    with engine.transaction(write=False):
        return int(engine.fetch("SELECT count(*) FROM segments")[0][0])


class EngineSource:
    """`gateway.history.source.Source` over an engine."""

    def __init__(self, engine: StoreEngine, objects: ObjectStore | None = None) -> None:
        self.engine, self.objects = engine, objects
        self._loader = RunLoader(objects)

    def runs(self, robot_id: str, wanted: SampleFilter, *, newest_first: bool, limit: int) -> Sequence[StoredRun]:
        return find_runs(self.engine, robot_id, wanted, limit=limit, newest_first=newest_first)

    def load(self, run: StoredRun) -> StoredBatch:
        return self._loader.load(self.engine, run)

    def newest(self, robot_id: str, topics: Sequence[str], t_ns: int) -> Sequence[Newest]:
        return [self._newest(robot_id, topic, t_ns) for topic in topics]

    def _newest(self, robot_id: str, topic: str, t_ns: int) -> Newest:
        try:
            run = self._loader.newest(self.engine, newest_candidates(self.engine, robot_id, topic, t_ns), t_ns)
            return None if run is None else self.load(run)
        except DamagedError as error:
            return error

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
