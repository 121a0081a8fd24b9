"""kill -9 of a gateway that watches: afterwards the judge is, bit by bit, one that was never interrupted."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from gateway.alerting.anomaly.detectors.bank import Learned
from gateway.alerting.anomaly.evaluator import Evaluator
from gateway.alerting.watch.bands import Bands
from gateway.alerting.watch.entries import Cycle
from gateway.alerting.watch.evaluation import EvaluationThread
from gateway.alerting.watch.intake import Intake
from gateway.alerting.watch.state_machine import StateMachine
from gateway.alerting.watch.watch_files import WatchFiles
from gateway.store.engine import StoreEngine
from gateway.store.engines import open_engine
from gateway.store.telemetry.query import read_metric_marks, read_series
from gateway.store.telemetry.series import read_range
from metaros.clock import ManualClock
from tests.support.gateways.wave_robot import SERIES, WaveStack
from tests.support.waiting import wait_until

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


def restored(folder: Path, engine: StoreEngine, now_s: float) -> StateMachine:
    """The judge as the next gateway on this directory has it, after its first turn."""
    files = WatchFiles(folder)
    files.begin()
    intake = Intake(files)
    evaluation = EvaluationThread(intake, Bands(), clock=ManualClock())
    marks = evaluation.restore(read_metric_marks(engine))
    for _ in range(TURNS):
        evaluation.run_cycle(Cycle(now_s=now_s, marks=marks, facts=[]))
        marks = {}
    intake.close()
    return evaluation.state_machine


def uninterrupted(rows: list[Row], now_s: float) -> StateMachine:
    """A judge that was given the stored rows at a stretch, cut as it comes."""
    state_machine, rng = StateMachine(), np.random.default_rng(1)  # how rows are cut must not matter
    position = 0
    while position < len(rows):
        some = rows[position : position + int(rng.integers(1, 3000))]
        position += len(some)
        slots = np.array([state_machine.evaluator.slot(ROBOT, series, topic=topic) for _, series, topic, _ in some])
        stamps_s = np.array([stamp_ns for stamp_ns, *_ in some]) / 1e9
        state_machine.evaluator.samples(slots, stamps_s, np.array([value for *_, value in some]))
        state_machine.evaluator.tick(now_s)
    for _ in range(TURNS):
        state_machine.evaluator.tick(now_s)
    return state_machine


class State(NamedTuple):
    """What a judge says of a series, and everything that it learned of it, bit by bit."""

    score: float
    band: tuple[float, float]
    learned: Learned
    bank: bytes
    flat: tuple[bytes, ...]


def known(state_machine: StateMachine) -> dict[str, State]:
    """What a judge says of each series."""
    evaluator = state_machine.evaluator
    return {
        name: State(evaluator.score(slot), evaluator.band(slot), evaluator.learned(slot), *state_of(evaluator, slot))
        for name, slot in evaluator.series(ROBOT)
        if not name.startswith("topic_rates.")
    }


def state_of(evaluator: Evaluator, slot: int) -> tuple[bytes, tuple[bytes, ...]]:
    """What the novelties and the search for frozen values hold of a series."""
    detectors = evaluator._detectors
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
