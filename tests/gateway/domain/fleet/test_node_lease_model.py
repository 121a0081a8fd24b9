"""Leases of migratable nodes against everything that can happen: two gateways on one store, three robots, and between
them frames that are late or lost, links that are half dead, clocks that run apart, restarts and pauses of all of them.

The robots' side is the real one: the moments that an agent tells, and the leases of the supervisor. Whatever happens, a
unit never runs on two robots at once, every new holder has a higher epoch, and when nothing more goes wrong every unit
runs again, and stays where it is.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Collection
from dataclasses import dataclass, field

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from edge_agent.nodes.lease_stamps import LeaseStamps
from gateway.domain.fleet.node_lease import LeaseTerms, NodeLeases, Step, Unit, UnitLease
from metaros.supervise.lease import LeaseAction, Leases

__all__ = ["TestFailover", "TestFailoverAlone"]

TERMS = LeaseTerms(valid_s=5.0, margin_s=1.0, answer_s=2.0, shunned_s=60.0)
UNITS = (Unit("all", "map"), Unit("all", "plan"), Unit("robot/r1", "own"))
ROBOTS = ("r1", "r2", "r3")
GRACE_S = 1.0


@dataclass
class Clock:
    """A machine's own: it began at some time, and runs a little too fast or too slow."""

    offset_s: float
    speed: float

    def read(self, true_s: float) -> float:
        return self.offset_s + true_s * self.speed


@dataclass
class Link:
    """A connection as both ends see it; they may be of two minds whether it lives."""

    gateway: Gateway
    robot: Robot
    down: deque[tuple[int, list[UnitLease]]] = field(default_factory=deque)
    up: deque[int] = field(default_factory=deque)


@dataclass
class Robot:
    """An agent with its supervisor."""

    name: str
    clock: Clock
    able: dict[Unit, bool]
    supervisor: Leases = field(default_factory=Leases)
    stamps: LeaseStamps = field(default_factory=LeaseStamps)
    link: Link | None = None
    epochs: dict[str, int] = field(default_factory=dict)


@dataclass
class Gateway:
    """One process, and what it has planned and not yet done."""

    number: int
    clock: Clock
    leases: NodeLeases
    links: dict[str, Link] = field(default_factory=dict)
    planned: list[Step] = field(default_factory=list)


class Failover(RuleBasedStateMachine):
    """The fleet. `true_s` is the time that nobody in it can read."""

    gateways_count = 2

    def __init__(self) -> None:
        super().__init__()
        self.true_s = 0.0
        self.rows: dict[Unit, UnitLease] = {}
        self.lives = 0
        self.begun: dict[Unit, tuple[int, str]] = {}  # the highest epoch that any robot ever ran it under

    @initialize(
        offsets=st.lists(st.floats(0, 1e6), min_size=5, max_size=5),
        speeds=st.lists(st.floats(0.93, 1.07), min_size=5, max_size=5),
    )
    def begin(self, offsets: list[float], speeds: list[float]) -> None:
        clocks = [Clock(offset, speed) for offset, speed in zip(offsets, speeds, strict=True)]
        self.robots = {
            name: Robot(name, clock, {unit: True for unit in UNITS if unit.scope in ("all", f"robot/{name}")})
            for name, clock in zip(ROBOTS, clocks, strict=False)
        }
        self.gateways = [
            Gateway(number, clock, self.life()) for number, clock in enumerate(clocks[3 : 3 + self.gateways_count])
        ]
        for gateway in self.gateways:
            self.read(gateway)
        for place, name in enumerate(ROBOTS):
            self.connects(name, place)
        for _ in range(9):
            self.beat()
        assert sorted(self.running()) == sorted(UNITS)

    def life(self) -> NodeLeases:
        self.lives += 1
        return NodeLeases(f"life-{self.lives}", TERMS, shared=self.gateways_count > 1)

    # -- gateways --------------------------------------------------------------------------------------------------

    def read(self, gateway: Gateway) -> None:
        """As the failover does it: not while a write is under way."""
        if gateway.planned:
            return
        gateway.leases.learn(list(self.rows.values()), now_s=gateway.clock.read(self.true_s))

    def plan(self, gateway: Gateway) -> None:
        steps = gateway.leases.plan(now_s=gateway.clock.read(self.true_s), wall_ns=0)
        gateway.leases.took(step for step in steps if not step.written)
        written = [step for step in steps if step.written]
        if written and not gateway.planned:
            gateway.leases.begin(written)
            gateway.planned = written

    def write(self, gateway: Gateway) -> None:
        """What was planned, perhaps long ago: each step alone, and only onto the row that it was planned for."""
        if not gateway.planned:
            return
        done = []
        for step in gateway.planned:
            if self.rows.get(step.after.unit) == step.before:
                self.rows[step.after.unit] = step.after
                done.append(step)
        gateway.planned = []
        gateway.leases.took(done)
        self.read(gateway)

    def tell(self, gateway: Gateway) -> None:
        for robot in list(gateway.leases.robots):
            if robot in gateway.links:
                gateway.links[robot].down.append(gateway.leases.frame(robot))

    which = st.integers(0, 1)
    robot = st.sampled_from(ROBOTS)

    def gateway(self, number: int) -> Gateway:
        return self.gateways[number % len(self.gateways)]

    @rule(number=which)
    def look(self, number: int) -> None:
        self.read(self.gateway(number))

    @rule(number=which)
    def plans(self, number: int) -> None:
        self.plan(self.gateway(number))

    @rule(number=which)
    def writes(self, number: int) -> None:
        self.write(self.gateway(number))

    @rule(number=which)
    def tells(self, number: int) -> None:
        self.tell(self.gateway(number))

    @rule(number=which)
    def works(self, number: int) -> None:
        """All of it at once, as it mostly is."""
        gateway = self.gateway(number)
        self.read(gateway)
        self.plan(gateway)
        self.write(gateway)
        self.tell(gateway)

    @rule(number=which, late=st.booleans())
    def restarts(self, number: int, late: bool) -> None:
        """It is killed. What it was writing comes to the store yet, or does not."""
        gateway = self.gateway(number)
        for name in list(gateway.links):
            self.ends(gateway, name)
            if (link := self.robots[name].link) is not None and link.gateway is gateway:
                self.robots[name].link = None
        if late:
            self.write(gateway)
        gateway.planned = []
        gateway.leases = self.life()
        self.read(gateway)

    # -- links -----------------------------------------------------------------------------------------------------

    def ends(self, gateway: Gateway, name: str) -> None:
        """The gateway sees that a link is gone."""
        gateway.links.pop(name, None)
        gateway.leases.linked(name)
        gateway.leases.offer(name, {})

    @rule(name=robot, number=which)
    def connects(self, name: str, number: int) -> None:
        """The agent goes to a gateway; the one where it was may not notice."""
        robot, gateway = self.robots[name], self.gateway(number)
        self.ends(gateway, name)
        robot.link = gateway.links[name] = Link(gateway, robot)
        robot.stamps.forget()
        gateway.leases.offer(name, dict(robot.able))

    @rule(name=robot)
    def agent_loses_its_link(self, name: str) -> None:
        self.robots[name].link = None

    @rule(name=robot, number=which)
    def gateway_notices(self, name: str, number: int) -> None:
        gateway = self.gateway(number)
        link = gateway.links.get(name)
        if link is not None and link.robot.link is not link:
            self.ends(gateway, name)

    @rule(name=robot)
    def frame_comes(self, name: str) -> None:
        """The oldest frame of the robot's link, however long it lay there."""
        robot = self.robots[name]
        if robot.link is None or not robot.link.down:
            return
        since_ns, leases = robot.link.down.popleft()
        now_ns = round(robot.clock.read(self.true_s) * 1e9)
        robot.link.up.append(robot.stamps.issue(now_ns))
        if not robot.stamps.knows(since_ns):
            return
        given = [(held.unit.node, held.lease_id, TERMS.valid_s) for held in leases]
        robot.supervisor.replace(given, age_s=(now_ns - since_ns) / 1e9, now_s=now_ns / 1e9)
        for held in leases:
            robot.epochs[held.unit.node] = held.epoch
            if robot.supervisor.duty(held.unit.node, GRACE_S, now_ns / 1e9) is LeaseAction.RUN:
                epoch, holder = self.begun.get(held.unit, (0, ""))
                assert (held.epoch, name) == (epoch, holder) or held.epoch > epoch, "an old lease came to life"
                self.begun[held.unit] = (held.epoch, name)

    @rule(name=robot, number=which)
    def answer_comes(self, name: str, number: int) -> None:
        """Also over a link that the agent has long given up."""
        gateway = self.gateway(number)
        link = gateway.links.get(name)
        if link is not None and link.up:
            gateway.leases.answered(name, link.up.popleft(), now_s=gateway.clock.read(self.true_s))

    @rule(name=robot, number=which)
    def round_trip(self, name: str, number: int) -> None:
        """A quick one."""
        robot, gateway = self.robots[name], self.gateway(number)
        if robot.link is None or robot.link.gateway is not gateway:
            self.connects(name, number)
        self.tell(gateway)
        assert robot.link is not None
        while robot.link.down:
            self.frame_comes(name)
        while robot.link.up:
            self.answer_comes(name, number)

    # -- the rest --------------------------------------------------------------------------------------------------

    @rule(seconds=st.floats(0.0, 3.0))
    def time_goes_by(self, seconds: float) -> None:
        self.true_s += seconds

    @rule(name=robot, unit=st.sampled_from(UNITS), able=st.booleans())
    def node_gets_ill_or_well(self, name: str, unit: Unit, able: bool) -> None:
        robot = self.robots[name]
        if unit in robot.able:
            robot.able[unit] = able
            if robot.link is not None and robot.link.gateway.links.get(name) is robot.link:
                robot.link.gateway.leases.offer(name, dict(robot.able))

    @rule(
        seconds=st.integers(1, 9),
        cut=st.sets(robot, max_size=2),
        paused=st.sampled_from((None, None, 0, 1)),
        storeless=st.sampled_from((None, None, 0, 1)),
        half=st.booleans(),
    )
    def some_time_without(
        self, seconds: int, cut: set[str], paused: int | None, storeless: int | None, half: bool
    ) -> None:
        """Some are cut off, a gateway stands still, or cannot ask its store, and life goes on with the rest. `half`:
        frames to those that are cut off gather in a buffer, and come later.
        """
        for name in sorted(cut):
            if not half:
                for gateway in self.gateways:
                    self.ends(gateway, name)
                self.robots[name].link = None
        for _ in range(seconds):
            self.beat(cut, paused, storeless)

    @rule(name=robot)
    def host_is_lost(self, name: str) -> None:
        """For good, as it seems: what ran there runs elsewhere soon, where somebody is able."""
        self.all_is_well_again()
        self.robots[name].link = None
        for _ in range(10):
            self.beat()
        holders = self.running()
        assert all(name not in holders[unit] for unit in UNITS if unit.scope == "all")

    @rule(name=robot)
    def machine_starts_again(self, name: str) -> None:
        """And its clock with it."""
        robot = self.robots[name]
        robot.clock.offset_s = -self.true_s * robot.clock.speed
        robot.supervisor, robot.link = Leases(), None
        robot.stamps.forget()

    @rule()
    def all_is_well_again(self) -> None:
        """Every unit runs, on one robot, and there it stays."""
        for robot in self.robots.values():
            robot.able.update(dict.fromkeys(robot.able, True))
        for gateway in self.gateways:
            for name in list(gateway.links):
                self.ends(gateway, name)
        for place, name in enumerate(ROBOTS):
            self.connects(name, place)
        for _ in range(16):
            self.beat()
        holders = self.running()
        assert sorted(holders) == sorted(UNITS)
        for _ in range(4):
            self.beat()
            assert self.running() == holders

    def beat(self, cut: Collection[str] = (), paused: int | None = None, storeless: int | None = None) -> None:
        for name in ROBOTS:
            link = self.robots[name].link
            if link is None or link.gateway.number == paused or name in cut:
                continue
            if link.gateway.links.get(name) is not link:  # it was given up there
                self.connects(name, link.gateway.number)
            self.round_trip(name, link.gateway.number)
        for gateway in self.gateways:
            if gateway.number == storeless:
                self.plan(gateway)
                self.tell(gateway)
            elif gateway.number != paused:
                self.works(gateway.number)
        for name in ROBOTS:
            link = self.robots[name].link
            while link is not None and link.down and name not in cut:
                self.frame_comes(name)
        self.check()
        self.true_s += 1.0
        self.check()

    def running(self) -> dict[Unit, list[str]]:
        """Where a unit may have a process now."""
        found: dict[Unit, list[str]] = {}
        for name, robot in self.robots.items():
            for unit in robot.able:
                lease = robot.supervisor.get(unit.node)
                if lease is not None and robot.clock.read(self.true_s) < lease.until_s:
                    found.setdefault(unit, []).append(name)
        return found

    @invariant()
    def check(self) -> None:
        if self.true_s:
            for unit, names in self.running().items():
                assert len(names) == 1, f"{unit} runs on {names}"


class FailoverAlone(Failover):
    """One gateway with a store of its own: a renewal needs no write."""

    gateways_count = 1


TestFailover = pytest.mark.timeout(300)(Failover.TestCase)
TestFailover.settings = settings(max_examples=30, stateful_step_count=20)
TestFailoverAlone = pytest.mark.timeout(300)(FailoverAlone.TestCase)
TestFailoverAlone.settings = settings(max_examples=30, stateful_step_count=20)
