"""A robot's detectors in another evaluator go on as if they had never moved, to the last bit."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from gateway.alerting.anomaly.detectors.bank import BankConfig, SnapshotError
from gateway.alerting.anomaly.detectors.flat import Flat
from gateway.alerting.anomaly.detectors.lasting import LastingConfig
from gateway.alerting.anomaly.detectors.robot_state import pack_robot, unpack_robot
from gateway.alerting.anomaly.detectors.vector import VectorConfig
from gateway.alerting.anomaly.evaluator import Evaluator, EvaluatorConfig
from gateway.domain.finding import Edge
from tests.gateway.alerting.anomaly.cellfeed import quick

START_S = 1_000_000_000
BAD_S, END_S = 200, 370  # all is learned by then; the end
CONFIG = EvaluatorConfig(
    bank=BankConfig(times=3.0, learn_s=150.0),
    lasting=quick(LastingConfig(learn_s=600, epoch_s=300)),
    vector=VectorConfig(learn=60, refresh=10, period_s=1.0),
)
MOTOR, WAVE = "left.motor_temperature.temperature", "imu.angular_velocity.z"
ODOM, CHARGE = "odom.x", "battery.percentage"
TOPICS = {MOTOR: "/left/motor", WAVE: "/imu", ODOM: "/odom", CHARGE: "/battery"}
Rows = tuple[str, float, float]  # series, stamp, value


@cache
def rows_of(robot: str, second: int) -> list[Rows]:
    """Five rows of each series; from `BAD_S` on something is wrong with robot r1 all the time."""
    rng = np.random.default_rng([int(robot[1:]), second])
    values = np.array((40.0, 0.0, 0.5, 0.8)) + np.array((0.15, 0.15, 0.15, 0.01)) * rng.normal(size=(5, 4))
    bad = second - BAD_S if robot == "r1" else -1
    sway = 0.6 * np.sin(second / 7.0)  # what belongs together
    values += np.array((sway, sway, -sway if 10 <= bad < 50 else sway, 0.0))
    silent, frozen, rare = 50 <= bad < 75, 80 <= bad < 115, 60 <= bad < 110
    if 50 <= bad < 90:
        values[:, 0] += 50.0
        values[:, 1] += 3.0
    if 95 <= bad < 130:
        values[:, 1] *= 5.0
    if frozen:
        values[:, 2] = 0.625
    found = []
    for step in range(5):
        for place, series in enumerate(TOPICS):
            if (series == ODOM and silent) or (series == CHARGE and rare and step):
                continue
            found.append((series, START_S + second + 0.05 + 0.2 * step, float(values[step, place])))
    return found


class Judges:
    """Some judges; each robot's rows and facts go to the one that has it."""

    def __init__(self, count: int, robots: Iterable[str], others: int = 0) -> None:
        self.judges = [Evaluator(CONFIG) for _ in range(count)]
        for evaluator in self.judges:
            evaluator._detectors.flat = Flat(changes=130)  # what froze is judged sooner than after half an hour
        for number in range(others):  # so that numbers differ
            self.judges[-1].slot(f"other{number}", "x.y", "/x")
        self.owner = dict.fromkeys(robots, self.judges[0])
        self.history: dict[str, list[Rows]] = {robot: [] for robot in robots}
        self.edges: list[tuple[str, Edge]] = []
        self.second = 0

    def feed(self, robot: str, rows: list[Rows]) -> None:
        evaluator = self.owner[robot]
        slots = [evaluator.slot(robot, series, TOPICS[series]) for series, _, _ in rows]
        evaluator.samples(np.array(slots), np.array([row[1] for row in rows]), np.array([row[2] for row in rows]))

    def run(self, seconds: int, *, facts: bool = True) -> None:
        for _ in range(seconds):
            now_s = START_S + self.second + 1.0
            for robot, evaluator in self.owner.items():
                rows = rows_of(robot, self.second)
                self.history[robot] = [*self.history[robot], *rows][-1200:]
                self.feed(robot, rows)
                if facts:
                    self._facts(evaluator, robot, now_s)
            for evaluator in self.judges:
                self.edges += [(edge.finding.robot, edge) for edge in evaluator.tick(now_s)]
            self.second += 1

    def _facts(self, evaluator: Evaluator, robot: str, now_s: float) -> None:
        bad = self.second - BAD_S if robot == "r1" else -1
        if not 110 <= bad < 155:
            evaluator.heartbeat(robot, now_s)
        if bad in (20, 25, 30, 35):
            for up in (False, True, False, True):
                evaluator.link(robot, up, now_s)
            evaluator.gap(robot, "/scan", 5, now_s)
            evaluator.node(robot, "driver", "restarted", now_s)
        evaluator.rates(robot, {"/camera/image": 4.0 if 40 <= bad < 110 else 30.0}, now_s)

    def move(self, robot: str, evaluator: Evaluator, state: bytes | None = None) -> None:
        """With the rows that the state does not have, as the store has them."""
        state = state if state is not None else self.owner[robot].dump_robot(robot)
        self.owner[robot].forget(robot)
        self.owner[robot] = evaluator
        evaluator.load_robot(robot, state)
        _, done = evaluator.judged_s(robot)
        self.feed(robot, [row for row in self.history[robot] if row[1] // 1.0 > done[row[0]]])

    def told(self, robot: str) -> list[tuple[str, str, str, float]]:
        kinds = [
            (edge.change, edge.finding.series, edge.finding.kind, edge.at_s)
            for name, edge in self.edges
            if name == robot
        ]
        return sorted(kinds, key=lambda kind: (kind[3], kind))

    def state(self, robot: str) -> dict[str, object]:
        """All that is known of a robot, but for what is compared with others once a minute of the evaluator's own."""
        words, groups = unpack_robot(self.owner[robot].dump_robot(robot))
        arrays = {(group, name): array for group, named in groups.items() for name, array in named.items()}
        numbers = {
            ("slot.slots", "topic"),
            ("slot.cells", "robot"),
            ("slot.novelties", "bank"),
            ("topic.topics", "robot"),
        }
        numbers |= {("robot.vectors", "slots"), ("values", "slot")}
        plain = {
            key: (array.dtype, array.shape, array.tobytes())
            for key, array in arrays.items()
            if key not in numbers and key[0] not in ("slot.cohorts",) and key != ("topic.topics", "first_s")
        }
        return {"words": words, **{"/".join(key): value for key, value in plain.items()}}


@pytest.fixture(scope="module")
def calm() -> tuple[Judges, Judges]:
    """Nothing ever moved: how it was when things went wrong for the first time, and at the end."""
    made = Judges(1, ("r1", "r2"))
    made.run(BAD_S)
    learnt = Judges(2, ("r1",), others=3)
    learnt.second, learnt.history["r1"] = BAD_S, made.history["r1"]
    learnt.judges[0].load_robot("r1", made.owner["r1"].dump_robot("r1"))
    made.run(END_S - BAD_S)
    return learnt, made


def test_scores_findings_and_all_that_is_learned_are_the_same_after_any_moves(calm: tuple[Judges, Judges]) -> None:
    _, stayed = calm
    rng = np.random.default_rng(0)
    moving = Judges(2, ("r1", "r2"), others=7)
    stops = sorted(rng.choice(np.arange(1, END_S), 14, replace=False).tolist())
    for stop in [*stops, END_S]:
        moving.run(int(stop) - moving.second)
        for robot in ("r1", "r2"):
            moving.move(robot, moving.judges[int(rng.integers(2))])
    for robot in ("r1", "r2"):
        assert moving.told(robot) == stayed.told(robot)
        assert moving.state(robot) == stayed.state(robot)
    kinds = {kind for _, _, kind, _ in stayed.told("r1")}
    wanted = {"level", "novelty", "motor_hot", "silence", "rate_low", "frozen", "vibration", "together"}
    assert kinds >= wanted | {"offline", "link_flaps", "sequence", "crash_loop"}


def test_after_a_kill_what_came_since_the_state_was_saved_is_found_once(calm: tuple[Judges, Judges]) -> None:
    moving, stayed = calm
    for _ in range(8):
        state = moving.owner["r1"].dump_robot("r1")
        before = len(moving.edges)
        moving.run(17, facts=False)
        del moving.edges[before:]  # the state knows nothing of them
        other = next(evaluator for evaluator in moving.judges if evaluator is not moving.owner["r1"])
        moving.move("r1", other, state)
        moving.run(3)
    facts = ("offline", "link_flaps", "sequence", "crash_loop", "behind")
    mine, theirs = (
        [
            item
            for item in made.told("r1")
            if item[2] not in facts and "camera" not in item[1] and item[3] < START_S + END_S - 10
        ]
        for made in (moving, stayed)
    )
    assert mine == theirs
    assert len(mine) > 10


def test_what_is_no_state_begins_anew() -> None:
    made = Judges(2, ("r0",))
    made.run(30)
    state, evaluator = made.owner["r0"].dump_robot("r0"), made.judges[1]
    words, groups = unpack_robot(state)
    other = pack_robot({**words, "config": "other"}, groups)
    fewer = pack_robot({**words, "series": words["series"][:2]}, groups)
    missing = pack_robot(words, {name: group for name, group in groups.items() if name != "slot.flat"})
    nonsense = pack_robot({"config": words["config"], "opened": 3}, {})
    for damaged in (b"", state[:-1], state[:100] + b"x" + state[101:], other, fewer, missing, nonsense):
        with pytest.raises(SnapshotError):
            evaluator.load_robot("r0", damaged)
        assert evaluator.robots() == []
        assert len(evaluator._detectors.novelties.bank) == 0
    made.move("r0", evaluator)
    made.run(30)
    assert evaluator.learned(evaluator.find("r0", WAVE)).seen == 60


def test_a_robot_without_series_moves_with_what_is_known_of_its_link() -> None:
    here, there = Evaluator(CONFIG), Evaluator(CONFIG)
    here.link("r", True, START_S)
    here.link("r", False, START_S + 1)
    there.load_robot("r", here.dump_robot("r"))
    assert [edge.finding.kind for edge in there.tick(START_S + 31.0)] == ["offline"]


def test_an_evaluator_that_has_no_room_takes_none_of_it() -> None:
    made = Judges(1, ("r0",))
    made.run(5)
    small = Evaluator(replace(CONFIG, slots=3))
    with pytest.raises(SnapshotError):
        small.load_robot("r0", made.owner["r0"].dump_robot("r0"))
    assert small.robots() == []
