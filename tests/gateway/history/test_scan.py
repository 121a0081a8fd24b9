"""The walk over a store that changes under it: nothing is passed over, nothing comes twice."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

from gateway.errors import DamagedError, InvalidRequestError, PurgedError
from gateway.history import scan as walks
from gateway.history.scan import Scan
from gateway.store.commit import Committer
from gateway.store.engine import StoreEngine
from gateway.store.objects import open_objects
from gateway.store.telemetry.samples import SampleFilter, StoredBatch, StoredRun
from tests.gateway.history.source import EngineSource, compact_all
from tests.gateway.store.samples import run_write

ALL = {"robot_id": "r1", "topics": ("/events",), "start_ns": 0, "end_ns": 1 << 60}


def fill(engine: StoreEngine, *, batches: int = 9, size: int = 5) -> list[int]:
    """Batches of one stream; the numbers of their messages, which are their stamps less 1000."""
    writes = [run_write(1 + size * n, [f"{1 + size * n + i}".encode() for i in range(size)]) for n in range(batches)]
    Committer(engine).commit(writes, now_ns=1)
    return list(range(1, batches * size + 1))


class Compacting(EngineSource):
    """After the second window is found, and before it is loaded, all batches become segments."""

    windows = 0

    def runs(self, robot_id: str, wanted: SampleFilter, *, newest_first: bool, limit: int) -> Sequence[StoredRun]:
        found = super().runs(robot_id, wanted, newest_first=newest_first, limit=limit)
        self.windows += 1
        if self.windows == 2:
            assert self.objects is not None
            assert compact_all(self.engine, self.objects) == 1
        return found


def test_every_message_comes_once_in_order(engine: StoreEngine, source: Callable[..., EngineSource]) -> None:
    numbers, at = fill(engine), source()
    for newest_first in (False, True):
        for window_runs in (1, 2, 256):
            scan = Scan(source=at, newest_first=newest_first, window_runs=window_runs, **ALL)
            found = [message.seq for message in scan.messages()]
            assert found == (numbers[::-1] if newest_first else numbers), (newest_first, window_runs)


@pytest.mark.parametrize("newest_first", [False, True])
def test_runs_that_overlap_in_time_are_reported_apart_by_no_window(engine: StoreEngine, newest_first: bool) -> None:
    """One topic's runs are long, those of the other many and short, between the stamps of a long one."""
    numbers = fill(engine, batches=3, size=6)
    short = [run_write(n, [b"x"], stream_id=8, topic="/short", stamp_ns=1000) for n in range(1, 19)]
    Committer(engine).commit(short, now_ns=1)
    wanted = {**ALL, "topics": ("/events", "/short")}
    for window_runs in (2, 3, 7, 256):
        scan = Scan(source=EngineSource(engine), newest_first=newest_first, window_runs=window_runs, **wanted)
        found = [(message.seq, message.payload == b"x") for message in scan.messages()]
        assert sorted(found) == sorted((number, is_short) for number in numbers for is_short in (False, True))
        in_turn = [seq for seq, _ in found]
        assert in_turn == sorted(in_turn, reverse=newest_first), window_runs


@pytest.mark.parametrize("newest_first", [False, True])
def test_compaction_meanwhile_changes_nothing(engine: StoreEngine, tmp_path: Path, newest_first: bool) -> None:
    numbers = fill(engine, batches=20)
    source = Compacting(engine, open_objects("", tmp_path))
    scan = Scan(source=source, newest_first=newest_first, window_runs=3, **ALL)
    found = [(message.seq, int(message.payload)) for message in scan.messages()]
    assert found == [(number, number) for number in (numbers[::-1] if newest_first else numbers)]
    assert source.windows >= 3


@pytest.mark.parametrize("newest_first", [False, True])
def test_stamps_that_stand_still(engine: StoreEngine, newest_first: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Batches with one and the same stamp do not fit a window, which grows; beyond a bound it is an error."""
    writes = [run_write(n, [b"x"], stamp_ns=5000 - n) for n in range(1, 8)]
    Committer(engine).commit(writes, now_ns=1)
    scan = Scan(source=EngineSource(engine), newest_first=newest_first, window_runs=2, **ALL)
    assert sorted(message.seq for message in scan.messages()) == list(range(1, 8))
    monkeypatch.setattr(walks, "MOST_RUNS", 4)
    with pytest.raises(InvalidRequestError, match="5000"):
        list(scan.messages())


@pytest.mark.parametrize(("error", "reason"), [(DamagedError, "damaged"), (PurgedError, "purged")])
def test_what_cannot_be_read_is_a_loss_and_the_rest_goes_on(
    engine: StoreEngine, error: type[Exception], reason: str
) -> None:
    fill(engine)

    class Holed(EngineSource):
        def load(self, run: StoredRun) -> StoredBatch:
            if run.first_seq in (6, 11, 31):
                raise error("gone")
            return super().load(run)

    scan = Scan(source=Holed(engine), window_runs=2, **ALL)
    found = [message.seq for message in scan.messages()]
    assert found == [n for n in range(1, 46) if not (6 <= n <= 15 or 31 <= n <= 35)]
    assert [(loss.count, loss.reason, loss.topic) for loss in scan.losses] == [(15, reason, "/events")]


def test_a_stopped_walk_ends(engine: StoreEngine) -> None:
    fill(engine)
    seen: list[int] = []
    scan = Scan(source=EngineSource(engine), window_runs=2, stopped=lambda: len(seen) >= 7, **ALL)
    for message in scan.messages():
        seen += [message.seq]
    assert 7 <= len(seen) <= 15


def test_no_topic_is_no_message(engine: StoreEngine) -> None:
    fill(engine)
    scan = Scan(source=EngineSource(engine), robot_id="r1", topics=(), start_ns=0, end_ns=1 << 60)
    assert list(scan.messages()) == []
