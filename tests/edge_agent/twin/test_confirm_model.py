"""Commit-confirmed against everything that can happen: any order of messages, cuts, kills at every action, reboots.

The model knows what the gateway confirmed. Whatever happens, the robot lives by one whole document, by one that was
confirmed or that is on trial within its window; it never goes back behind what it kept, never tries again what it
has taken back, and once nothing more happens it lives by the last one confirmed.
"""

from __future__ import annotations

import json
import random  # noqa: TID251 - seeded
from collections.abc import Callable

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from edge_agent.twin.confirm import Action, Apply, CommitConfirm, Persist, Report
from edge_agent.twin.record import OWN, Record, Version
from edge_agent.twin.state import TwinFile
from metaros.clock import ManualClock
from tests.support.simulation.sim_disk import Crash, SimDisk

__all__ = ["TestConfirm"]


class Confirming(RuleBasedStateMachine):
    """A robot, its disk, its link and its gateway."""

    def __init__(self) -> None:
        super().__init__()
        self.disk = SimDisk(random.Random(1))
        self.clock, self.boots = ManualClock(), 1
        self.newest = 0
        self.versions = {0: OWN}
        self.granted: set[int] = {0}  # revisions that the gateway confirmed
        self.to_robot: list[tuple[str, int]] = []
        self.floor = 0  # the newest revision that was on the disk as applied
        self.undone: set[int] = set()  # taken back, and the disk knows it
        self.windows: dict[int, float] = {}
        self.up, self.works = False, True
        self.asked = 0
        self.lives = OWN
        self.begin()

    def begin(self) -> None:
        """A process starts on the disk."""
        self.up, self.asked = False, 0
        self.to_robot.clear()
        self.confirm = CommitConfirm(self.load(), self.clock, boot_id=f"boot-{self.boots}")
        self.do(self.confirm.start)

    def load(self) -> Record:
        return TwinFile(self.disk).load()

    def do(self, step: Callable[[], list[Action]]) -> None:
        """What a step asks for, as the shell does it; a crash in it is the end of the process."""
        try:
            self.perform(step())
        except Crash:
            self.disk.crash_in = None
            self.begin()

    def perform(self, actions: list[Action]) -> None:
        for action in actions:
            match action:
                case Persist(record):
                    if not self.works:
                        return self.perform(self.confirm.persist_failed("disk_error", "it failed"))
                    TwinFile(self.disk).keep(record)
                    self.confirm.persisted(record)
                    self.floor = record.applied.revision
                    if record.undone:
                        self.undone.add(record.seen)
                case Apply(version):
                    if self.disk._stops():
                        raise Crash
                    assert version.revision not in self.undone
                    pending = self.confirm.record.pending
                    assert pending is None or self.clock.monotonic_s() < pending.until_s
                    self.lives = version
                    self.perform(self.confirm.applied())
                case Report():
                    if self.up and self.confirm.state == "confirming":
                        self.asked = self.confirm.revision
        return None

    @rule(valid=st.booleans(), window_s=st.sampled_from([0.0, 2.0, 10.0]), risky=st.booleans())
    def desire(self, valid: bool, window_s: float, risky: bool) -> None:
        self.newest += 1
        name = "budget" if risky else "parameters"
        sections = {name: {"bytes_per_s": 1000 + self.newest} if risky else {"/n": {"a": self.newest}}}
        document = json.dumps(sections if valid else {"nonsense": {}}).encode()
        self.versions[self.newest] = Version(revision=self.newest, document=document)
        self.windows[self.newest] = window_s

    @precondition(lambda self: self.up and self.newest)
    @rule(back=st.integers(0, 2))
    def send(self, back: int) -> None:
        """The gateway sends a desired version, the newest or an old one, over the link."""
        if self.newest > back:
            self.to_robot.append(("desired", self.newest - back))

    @precondition(lambda self: self.up and self.asked)
    @rule()
    def grant(self) -> None:
        """The gateway has heard `confirming`."""
        self.to_robot.append(("confirmed", self.asked))
        self.asked = 0

    @precondition(lambda self: self.confirm.record.pending is not None)
    @rule(way=st.integers(0, 5))
    def guess(self, way: int) -> None:
        """A confirmation that is of another revision, or of another link."""
        revision = self.newest - way
        if revision not in self.granted and revision != self.confirm.record.seen:
            self.do(lambda: self.confirm.confirmed(revision))

    @precondition(lambda self: self.to_robot)
    @rule()
    def arrive(self) -> None:
        kind, revision = self.to_robot.pop(0)
        if kind == "confirmed":
            self.granted.add(revision)
            self.do(lambda: self.confirm.confirmed(revision))
            return
        version = self.versions[revision]
        before = self.confirm.record.pending
        window_s = self.windows[revision]
        self.do(lambda: self.confirm.desired(revision, version.sha256, version.document, window_s))
        pending = self.confirm.record.pending
        if pending is not None and pending != before:
            assert pending.until_s <= self.clock.monotonic_s() + (window_s or 60.0)

    @rule()
    def link(self) -> None:
        """It comes up, or is cut: what was on its way is lost."""
        self.up, self.asked = not self.up, 0
        self.to_robot.clear()
        self.do(lambda: self.confirm.link(self.up))

    @rule(seconds=st.sampled_from([0.1, 0.6, 2.1, 6.0, 61.0]))
    def time(self, seconds: float) -> None:
        """The shell ticks when it is told to."""
        end_s = self.clock.monotonic_s() + seconds
        while True:
            wait_s = self.confirm.wait_s()
            left_s = end_s - self.clock.monotonic_s()
            if wait_s is None or wait_s > left_s:
                break
            self.clock.advance(max(wait_s, 1e-3))
            self.do(lambda: self.confirm.tick())
        self.clock.advance(max(0.0, end_s - self.clock.monotonic_s()))
        self.do(lambda: self.confirm.tick())

    @rule(count=st.integers(0, 3))
    def kill_in(self, count: int) -> None:
        """The process is killed at one of its next actions."""
        self.disk.crash_in = count

    @rule(away_s=st.sampled_from([0.0, 1.0, 90.0]))
    def kill(self, away_s: float) -> None:
        self.disk.crash_in = None
        self.clock.advance(away_s)
        self.begin()

    @rule(monotonic_s=st.sampled_from([0.0, 1000.0, 5000.0]))
    def power_cut(self, monotonic_s: float) -> None:
        self.disk.crash_in = None
        self.clock, self.boots = ManualClock(monotonic_s=monotonic_s), self.boots + 1
        self.begin()
        assert self.confirm.record.pending is None

    @rule(works=st.booleans())
    def disk_works(self, works: bool) -> None:
        self.works = works

    @invariant()
    def it_lives_by_one_whole_version_that_was_confirmed_or_is_on_trial(self) -> None:
        assert self.lives == self.versions[self.lives.revision]
        pending, applied = self.confirm.record.pending, self.confirm.record.applied
        assert self.lives == (applied if pending is None else pending.version)
        assert applied.revision in self.granted
        if pending is not None:
            assert self.clock.monotonic_s() <= pending.until_s

    @invariant()
    def the_disk_has_one_whole_record_and_never_goes_back(self) -> None:
        record = self.load()
        assert record.applied.revision >= self.floor
        assert record.applied == self.versions[record.applied.revision]
        assert record.applied.revision in self.granted

    def teardown(self) -> None:
        self.works, self.disk.crash_in = True, None
        self.time(61.0)
        self.time(61.0)
        self.time(61.0)
        assert self.confirm.record.pending is None
        assert self.lives == self.confirm.record.applied == self.load().applied
        assert self.lives.revision in self.granted


TestConfirm = Confirming.TestCase
TestConfirm.settings = settings(max_examples=30, stateful_step_count=40, deadline=None)


WEIGHTS = {"desire": 8, "send": 16, "arrive": 30, "grant": 14, "guess": 2, "link": 6, "time": 12}
WEIGHTS |= {"kill_in": 2, "kill": 2, "power_cut": 1, "disk_works": 2}


@pytest.mark.parametrize("seed", range(8))
def test_long_random_lives(seed: int) -> None:
    """The same by chance alone, which goes deeper than what hypothesis draws; 40 lives a seed."""
    rng = random.Random(seed)
    commits = 0
    for _ in range(40):
        world = Confirming()
        for _ in range(100):
            act(world, rng)
            world.it_lives_by_one_whole_version_that_was_confirmed_or_is_on_trial()
            world.the_disk_has_one_whole_record_and_never_goes_back()
        commits += world.floor > 0
        world.teardown()
    assert commits > 5, "the worlds never come to a confirmed document: they show nothing"


def act(world: Confirming, rng: random.Random) -> None:
    """One thing happens that can happen now."""
    match rng.choices(list(WEIGHTS), list(WEIGHTS.values()))[0]:
        case "desire":
            world.desire(rng.random() < 0.8, rng.choice((0.0, 2.0, 10.0)), rng.random() < 0.5)
        case "send" if world.up and world.newest:
            world.send(rng.choice((0, 0, 0, 1, 2)))
        case "arrive" if world.to_robot:
            world.arrive()
        case "grant" if world.up and world.asked:
            world.grant()
        case "guess" if world.confirm.record.pending is not None:
            world.guess(rng.randrange(6))
        case "link":
            if not world.up or rng.random() < 0.3:
                world.link()
        case "time":
            world.time(rng.choice((0.1, 0.6, 2.1, 2.1, 6.0, 61.0)))
        case "kill_in":
            world.kill_in(rng.randrange(4))
        case "kill":
            world.kill(rng.choice((0.0, 1.0, 90.0)))
        case "power_cut":
            world.power_cut(rng.choice((0.0, 1000.0, 5000.0)))
        case "disk_works":
            world.disk_works(rng.random() < 0.7)
