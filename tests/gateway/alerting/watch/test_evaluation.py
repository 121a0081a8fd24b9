"""The evaluator's thread: whatever the instant of a kill, it goes on as if there had been none."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from random import Random  # noqa: TID251 - seeded

import numpy as np
import pytest

from gateway.alerting.anomaly.detectors import cells
from gateway.alerting.watch import evaluation as turns_module
from gateway.alerting.watch.bands import Bands
from gateway.alerting.watch.entries import Cycle, Mark
from gateway.alerting.watch.evaluation import EvaluationThread
from gateway.alerting.watch.intake import Intake
from gateway.alerting.watch.watch_files import WatchFiles
from gateway.domain.finding import Edge
from gateway.store.writes import StreamWrite
from metaros.clock import ManualClock
from tests.gateway.alerting.watch.made import START_S, write

SERIES = ("a.x", "a.y")


def wave(made: StreamWrite) -> StreamWrite:
    """The write with values that an evaluator has something to say about."""
    assert made.rows is not None
    numbers = made.rows.values.copy()
    made.rows.values[:] = 3.0 * (numbers // 700 % 2) + np.sin(numbers / 9) + numbers * 7919 % 101 / 300
    made.rows.stamps[:] = START_S * 10**9 + numbers.astype(np.int64) * 10**8
    return made


@dataclass
class World:
    """A gateway's store and watch; `kill` leaves files as they are."""

    folder: Path
    clock: ManualClock = field(default_factory=ManualClock)
    stored: dict[Mark, int] = field(default_factory=dict)
    told: dict[Mark, int] = field(default_factory=dict)
    edges: list[Edge] = field(default_factory=list)

    def start(self) -> None:
        """The next life."""
        files = WatchFiles(self.folder, log_bytes=40_000)
        files.begin()
        self.intake, self.bands = Intake(files), Bands()
        self.evaluation = EvaluationThread(self.intake, self.bands, clock=self.clock)
        self.told = self.evaluation.restore(dict(self.stored))

    def ahead(self, made: StreamWrite) -> None:
        """The store is about to commit."""
        self.intake.ahead([made])

    def commit(self, made: StreamWrite, *, told: bool = True) -> None:
        """It did; the loop may not have heard of it."""
        mark = (made.robot, made.stream_id, made.epoch)
        self.stored[mark] = made.seq
        if told:
            self.told[mark] = made.seq

    def run_cycle(self, *facts: list[object]) -> list[Edge]:
        """The evaluator's cycle."""
        self.clock.advance(1.0)
        marks, self.told = self.told, {}
        edges = self.evaluation.run_cycle(Cycle(now_s=START_S + 1.0, marks=marks, facts=facts))
        self.edges += edges
        return edges

    def settle(self) -> None:
        """Cycles until all is judged: of a robot a cycle judges so many seconds at most."""
        for _ in range(8):
            self.run_cycle()

    def judged(self) -> dict[str, tuple[float, ...]]:
        """What the evaluator says of the robot's series."""
        evaluator = self.evaluation.state_machine.evaluator
        return {
            name: (evaluator.score(slot), *evaluator.band(slot), *evaluator.learned(slot))
            for name, slot in evaluator.series("r1")
        }

    def dump(self) -> bytes:
        """Everything that the evaluator will depend on."""
        return self.evaluation.state_machine.evaluator.dump()


def plain(folder: Path, writes: list[StreamWrite]) -> World:
    """A world in which nothing ever happened."""
    world = World(folder)
    world.start()
    for made in writes:
        world.ahead(made)
        world.commit(made)
    world.settle()
    return world


def writes_of(rng: Random, rows: int, *, most: int = 120) -> list[StreamWrite]:
    """The stream, cut by chance into pieces of `most` rows at most."""
    made, first = [], 1
    while first <= rows:
        count = min(rng.randint(1, most), rows + 1 - first)
        made.append(wave(write(first, count, series=SERIES)))
        first += count
    return made


@pytest.mark.parametrize("seed", [0, 2])
def test_kills_at_any_instant_change_nothing(tmp_path: Path, seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(turns_module, "SNAPSHOT_S", 7.0)
    monkeypatch.setattr(turns_module, "RETRY_S", 0.0)
    monkeypatch.setattr(cells, "SECONDS_AT_ONCE", 20)  # there is more to be judged than a turn may
    rng = Random(seed)
    made = writes_of(rng, 1200, most=60)
    world = World(tmp_path / "killed")
    world.start()
    kills = 0
    for next_write in made:
        world.ahead(next_write)
        if rng.random() < 0.1:  # between the log and the commit: the robot sends it again
            world.start()
            kills += 1
            world.ahead(next_write)
        told = rng.random() < 0.9
        world.commit(next_write, told=told)
        if not told or rng.random() < 0.05:  # between the commit and its news, or after it
            world.start()
            kills += 1
        if rng.random() < 0.4:
            world.run_cycle()
    world.start()
    world.settle()
    calm = plain(tmp_path / "calm", made)
    assert kills > 8
    assert world.judged() == calm.judged()
    assert world.judged()["a.x"][3] > 100
    assert world.dump() == calm.dump()


def test_a_snapshot_that_is_damaged_lets_it_learn_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(turns_module, "SNAPSHOT_S", 5.0)
    monkeypatch.setattr(turns_module, "RETRY_S", 0.0)
    world = World(tmp_path)
    world.start()
    for made in writes_of(Random(1), 1500):
        world.ahead(made)
        world.commit(made)
        world.run_cycle()
    (path,) = [path for path in tmp_path.iterdir() if path.name.startswith("snapshot-")]
    path.write_bytes(path.read_bytes()[:-10])
    world.start()
    assert world.judged() == {}
    again = wave(write(1501, 10, series=SERIES))
    world.ahead(again)
    world.commit(again)
    world.run_cycle()
    assert set(world.judged()) == set(SERIES)


def test_facts_and_teaching_come_again_in_a_replay(tmp_path: Path) -> None:
    world = World(tmp_path)
    world.start()
    for made in writes_of(Random(2), 900):
        world.ahead(made)
        world.commit(made)
    world.run_cycle(
        ["link", "r1", True, START_S], ["robot", "r1", "model=x"], ["rates", "r1", {"/a": 9.5}, START_S + 90.0]
    )
    world.run_cycle(
        ["checks", {"novelty": {"severity": "warning"}}],
        ["accept", "r1", "a.x", "level", 1.5],
        ["gap", "r1", "s", 3, START_S],
    )
    dump = world.dump()
    world.start()
    assert world.dump() == dump


def test_a_robot_that_was_forgotten_is_learned_anew(tmp_path: Path) -> None:
    world = plain(tmp_path, [wave(write(1, 50, series=SERIES)), wave(write(1, 50, robot="r2", series=SERIES))])
    world.run_cycle(["forget", "r1"])
    assert world.judged() == {}
    again = wave(write(51, 50, series=SERIES))
    world.ahead(again)
    world.commit(again)
    world.settle()
    assert set(world.judged()) == set(SERIES)


def test_an_unknown_fact_ends_its_cycle_and_nothing_else(tmp_path: Path) -> None:
    world = World(tmp_path)
    world.start()
    assert world.run_cycle(["no such fact", 1]) == []
    world.run_cycle(["link", "r1", True, START_S])
    world.start()
    assert world.dump()


def test_wanted_series_have_points_and_learning_says_how_far(tmp_path: Path) -> None:
    world = World(tmp_path)
    world.start()
    world.bands.want("r1", "a.x")
    for made in writes_of(Random(3), 600):
        world.ahead(made)
        world.commit(made)
        world.run_cycle()
    points = world.bands.read("r1", "a.x", 0, 1 << 62)
    assert len(points) > 5
    assert points == sorted(points, key=lambda point: point.stamp_ns)
    assert all(math.isfinite(point.value) for point in points)
    assert points[-1].low is not None
    assert points[-1].high is not None
    rows = world.evaluation.learning("r1")
    assert [row.series for row in rows] == list(SERIES)
    assert all(row.seen > 0 for row in rows)
    assert world.evaluation.learning("nobody") == []


def test_a_store_that_takes_nothing_costs_no_row_twice(tmp_path: Path) -> None:
    world, calm = World(tmp_path / "a"), plain(tmp_path / "b", [wave(write(1, 600, series=SERIES))])
    world.start()
    for first in (1, 101, 201):  # given up
        world.ahead(wave(write(first, 100, series=SERIES)))
        world.run_cycle()
    again = wave(write(1, 600, series=SERIES))
    world.ahead(again)
    world.commit(again)
    world.settle()
    assert world.judged() == calm.judged()
    assert world.intake.pending.rows == 0
