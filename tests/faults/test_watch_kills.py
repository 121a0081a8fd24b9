"""kill -9 of a gateway that watches: afterwards the judge is, bit by bit, one that was never interrupted."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from gateway.anomaly.bank import Learned
from gateway.anomaly.judgement import Judge
from gateway.store.engine import StoreEngine
from gateway.store.engines import open_engine
from gateway.store.query import read_metric_marks, read_series
from gateway.store.series import read_range
from gateway.watch.bands import Bands
from gateway.watch.entries import Turn
from gateway.watch.intake import Intake
from gateway.watch.keeper import Keeper
from gateway.watch.mind import Mind
from gateway.watch.turns import Turns
from metaros.clock import ManualClock
from tests.support.waiting import wait_until
from tests.support.wave_robot import SERIES, WaveStack

KILLS = 2
TURNS = 10  # until all is judged: of a robot a turn judges five minutes at most
ROWS_A_LIFE = 1500  # of each series
ROBOT = "robot"
Row = tuple[int, str, str, float]  # stamp in ns, series, topic, value


def stored_rows(engine: StoreEngine) -> list[Row]:
    """Every row that the store has, by stamp."""
    rows: list[Row] = []
    for facts in read_series(engine, ROBOT):
        name, topic = facts.series.name, facts.series.topic
        (found,) = read_range(engine, ROBOT, [name], start_ns=0, end_ns=1 << 62, points=facts.samples)
        assert len(found.mean) == facts.samples
        stamps_ns = np.round(found.stamp_ms).astype(np.int64) * 10**6
        rows += zip(
            stamps_ns.tolist(), [name] * len(stamps_ns), [topic] * len(stamps_ns), found.mean.tolist(), strict=True
        )
    return sorted(rows)


def restored(folder: Path, engine: StoreEngine, now_s: float) -> Mind:
    """The judge as the next gateway on this directory has it, after its first turn."""
    keeper = Keeper(folder)
    keeper.begin()
    intake = Intake(keeper)
    turns = Turns(intake, Bands(), clock=ManualClock())
    marks = turns.restore(read_metric_marks(engine))
    for _ in range(TURNS):
        turns.turn(Turn(now_s=now_s, marks=marks, facts=[]))
        marks = {}
    intake.close()
    return turns.mind


def uninterrupted(rows: list[Row], now_s: float) -> Mind:
    """A judge that was given the stored rows at a stretch, cut as it comes."""
    mind, rng = Mind(), np.random.default_rng(1)  # how rows are cut must not matter
    position = 0
    while position < len(rows):
        some = rows[position : position + int(rng.integers(1, 3000))]
        position += len(some)
        slots = np.array([mind.judge.slot(ROBOT, series, topic=topic) for _, series, topic, _ in some])
        stamps_s = np.array([stamp_ns for stamp_ns, *_ in some]) / 1e9
        mind.judge.samples(slots, stamps_s, np.array([value for *_, value in some]))
        mind.judge.tick(now_s)
    for _ in range(TURNS):
        mind.judge.tick(now_s)
    return mind


class State(NamedTuple):
    """What a judge says of a series, and everything that it learned of it, bit by bit."""

    score: float
    band: tuple[float, float]
    learned: Learned
    bank: bytes
    flat: tuple[bytes, ...]


def known(mind: Mind) -> dict[str, State]:
    """What a judge says of each series."""
    judge = mind.judge
    return {
        name: State(judge.score(slot), judge.band(slot), judge.learned(slot), *state_of(judge, slot))
        for name, slot in judge.series(ROBOT)
        if not name.startswith("topic_rates.")
    }


def state_of(judge: Judge, slot: int) -> tuple[bytes, tuple[bytes, ...]]:
    """What the novelties and the search for frozen values hold of a series."""
    detectors = judge._detectors
    novelties = detectors.novelties
    bank = novelties.bank.dump([int(novelties.columns["bank"][slot])])
    return bank, tuple(array[slot].tobytes() for array in detectors.flat.columns.dump().values())


@pytest.mark.integration
def test_scores_after_kills_are_those_of_a_judge_that_never_was_interrupted(tmp_path: Path) -> None:
    with WaveStack(tmp_path) as stack:
        watched = stack.gateway_config.data_dir / "watch"
        stack.start("gateway")
        stack.start("robot")
        for life in range(1, KILLS + 1):
            stack.wait_online()
            rows = ROWS_A_LIFE * life + 37 * life  # some snapshots; whatever the kill meets is a good one
            wait_until(lambda rows=rows: stack.counters["metric"] >= rows, timeout_s=120)  # type: ignore[misc]
            wait_until(lambda: any(watched.glob("snapshot-*")))
            stack.kill("gateway")
            stack.start("gateway")
        stack.end()
    folder = stack.gateway_config.data_dir
    engine, _ = open_engine("", folder)
    try:
        rows = stored_rows(engine)
        now_s = rows[-1][0] / 1e9
        after, never = known(restored(folder / "watch", engine, now_s)), known(uninterrupted(rows, now_s))
    finally:
        engine.close()
    assert any(path.name.startswith("snapshot-") for path in (folder / "watch").iterdir())
    assert len(after) == len(never) == SERIES
    assert min(state.learned.seen for state in never.values()) > 300
    assert after == never
