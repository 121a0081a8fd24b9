"""A seeded world for the delivery contract: real agent and gateway halves, and everything between them made to fail.

The agent is its outbox on a simulated disk and its session; the gateway is its session and stream table before a
small store with the engine's one promise, that a commit is all or nothing. Frames travel through queues that can be
lost at any moment, while either side may learn of it only much later. Some worlds also copy the agent's disk and run
both, put it or the gateway's store back to an older backup, wipe it, or turn a bit of it over. Nothing here waits, and
nothing is random but by the seed.
"""

from __future__ import annotations

import random  # noqa: TID251 - seeded, one a world
from collections.abc import Collection
from dataclasses import dataclass

from edge_agent.uplink.session import LANES
from metaros.clock import ManualClock
from tests.support.simulation.sim_agent import LIMITS, Agent, Ledger
from tests.support.simulation.sim_disk import Crash, SimDisk
from tests.support.simulation.sim_gateway import Gateway, Key, Link, SimStore

__all__ = ["KINDS", "LinkSimulation", "Parts", "run_simulation"]

KIB = 1024
PLAIN = {
    "work": 40,
    "commit": 14,
    "cut": 3,
    "agent_crash": 2,
    "gateway_crash": 2,
    "disk_fails": 2,
    "disk_fills": 2,
    "store_fails": 2,
    "time": 4,
    "jump": 1,
    "storm": 1,
    "stall": 1,
}
KINDS = {
    "clone": {"clone": 2},
    "restore": {"back_up": 2, "restore": 1},
    "wipe": {"wipe": 1},
    "rollback": {"back_up_store": 2, "roll_back": 1},
    "rot": {"rot": 3},
}
KIND_SHARE = 0.12  # of the worlds have a kind; about half have none
MAX_AGENTS = 3


@dataclass(frozen=True)
class Parts:
    """What the world is made of; a test may break one."""

    gateway: type[Gateway] = Gateway
    store: type[SimStore] = SimStore
    agent: type[Agent] = Agent
    disk: type[SimDisk] = SimDisk


class LinkSimulation:
    """One robot, its gateway, and what happens to them."""

    def __init__(self, seed: int, *, kinds: Collection[str] | None = None, parts: Parts | None = None) -> None:
        self.rng = random.Random(seed)
        self.parts = parts if parts is not None else Parts()
        drawn = [kind for kind in KINDS if self.rng.random() < KIND_SHARE]
        self.kinds = set(drawn if kinds is None else kinds)
        acts = PLAIN | {act: weight for kind in sorted(self.kinds) for act, weight in KINDS[kind].items()}
        self._acts, self._weights = list(acts), list(acts.values())
        self.clock = ManualClock()
        self.store = self.parts.store()
        self.live: list[int] = []
        self.not_held: list[Key] = []
        self.forks = 0
        self._stamp = self._session = self._stalled = 0
        self._links: list[tuple[Agent, Link]] = []
        self._backup: tuple[SimDisk, Ledger] | None = None
        self._store_backup: SimStore | None = None
        self.gateway = self.new_gateway()
        disk = self.parts.disk(self.rng, size_bytes=self.rng.choice((1 << 40, 1 << 40, 120 * KIB)))
        self.agents = [self.parts.agent(self, disk, "a", Ledger())]
        self.agent = self.agents[0]

    # -- what the parts ask for -------------------------------------------------------------------------------------

    def next_stamp(self) -> int:
        """A number that no other sample has."""
        self._stamp += 1
        return self._stamp

    def next_session(self) -> int:
        """A number for a session."""
        self._session += 1
        return self._session

    def new_link(self, agent: Agent) -> Link:
        """The network carries another connection."""
        link = Link()
        self._links = [(one, known) for one, known in self._links if not known.lost]
        self._links.append((agent, link))
        return link

    def new_gateway(self) -> Gateway:
        """A gateway process on the store."""
        gateway = self.parts.gateway(self.store, self.clock, limits=LIMITS)
        gateway.live, gateway.not_held = self.live, self.not_held
        return gateway

    # -- what happens -----------------------------------------------------------------------------------------------

    def step(self) -> None:
        """One thing happens, to one of the agents."""
        if len(self.agents) > 1:
            self.agent = self.rng.choice(self.agents)
        getattr(self, self.rng.choices(self._acts, self._weights)[0])()

    def work(self) -> None:
        """The usual: samples come, are flushed, sent, and arrive."""
        rng, agent = self.rng, self.agent
        agent.check()
        self.gateway.tick()
        agent.connect()
        agent.produce(int(rng.random() * 12))
        if rng.random() < 0.7:
            agent.flush()
        for lane in LANES:
            agent.pump(lane, int(rng.random() * 4))
        self._stalled -= 1
        if self._stalled < 0:
            self.carry(int(rng.random() * 12))
        self.clock.advance(0.003)

    def carry(self, count: int) -> None:
        """Frames arrive, lane by lane in order, the lanes in any."""
        random, links = self.rng.random, self._links
        for _ in range(count):
            lane = LANES[int(random() * 3)]
            for agent, link in links:
                if link.up[lane]:
                    self.gateway.receive(link, lane, link.up[lane].popleft())
                if link.down[lane] and agent.link is link:
                    agent.hear(lane)

    def commit(self) -> None:
        """The gateway commits some of what waits."""
        self.gateway.commit(self.rng.choice((1, 3, 1000)))

    def cut(self, *, silent: bool = True) -> None:
        """Every connection breaks; where silent, either side may learn of it only by the other's silence."""
        for agent, link in self._links:
            link.lose()
            if agent.link is link and not (silent and self.rng.random() < 0.3):
                agent.ended()
            if self.rng.random() < 0.7:
                self.gateway.lane_ended(link)

    def agent_crash(self) -> None:
        """The agent dies, perhaps inside a write, and starts again on its disk."""
        agent = self.agent
        agent.disk.crash_in = self.rng.randrange(6)
        try:
            agent.produce(self.rng.randrange(12))
            agent.flush()
        except Crash:
            pass
        agent.disk.crash_in = None
        self.reboot(agent)

    def reboot(self, agent: Agent) -> None:
        """Another process on what is now the agent's disk."""
        self.cut(silent=False)
        agent.session = agent.link = None
        agent.start()

    def gateway_crash(self) -> None:
        """The gateway dies with what it had not committed."""
        self.forks += self.gateway.forks
        self.gateway = self.new_gateway()
        self.cut()

    def disk_fails(self) -> None:
        """One of the agent's next writes fails."""
        self.agent.disk.fail_in = self.rng.randrange(4)

    def disk_fills(self) -> None:
        """Somebody fills the agent's disk, or clears it."""
        disk = self.agent.disk
        disk.foreign_bytes = self.rng.choice((0, max(0, disk.free()[0] - self.rng.randrange(3000))))

    def store_fails(self) -> None:
        """The gateway's disk is full, or works again."""
        self.store.works = not self.store.works

    def time(self) -> None:
        """Time passes: lingers, pauses, heartbeats, and the death of what is silent."""
        self.clock.advance(self.rng.choice((0.02, 0.02, 0.2, 6.0)))

    def jump(self) -> None:
        """The robot's calendar is set ten years off."""
        self.clock.jump_wall(self.rng.choice((-1, 1)) * 315_000_000)

    def storm(self) -> None:
        """The gateway tells the agent to wait, over and over."""
        self.gateway.refusals = self.rng.randrange(1, 12)

    def stall(self) -> None:
        """Nothing arrives for a while, though nothing is lost: windows fill."""
        self._stalled = self.rng.randrange(1, 8)

    def clone(self) -> None:
        """The agent's disk is copied while it runs, and an agent started on the copy: from now on there are two."""
        if len(self.agents) < MAX_AGENTS:
            disk, ledger = self.agent.disk.copy(), self.agent.ledger.copy()
            self.agents.append(self.parts.agent(self, disk, "abc"[len(self.agents)], ledger))

    def back_up(self) -> None:
        """Somebody copies the agent's disk."""
        self._backup = (self.agent.disk.copy(), self.agent.ledger.copy())

    def restore(self) -> None:
        """Somebody puts the copy in the place of the agent's disk."""
        if self._backup is not None:
            disk, ledger = self._backup
            self.agent.disk, self.agent.ledger = disk.copy(), ledger.copy()
            self.reboot(self.agent)

    def wipe(self) -> None:
        """The agent starts again on an empty disk."""
        self.agent.disk.files, self.agent.ledger = {}, Ledger()
        self.reboot(self.agent)

    def back_up_store(self) -> None:
        """Somebody copies the gateway's store."""
        self._store_backup = self.store.copy()

    def roll_back(self) -> None:
        """The gateway starts again on the copy."""
        if self._store_backup is not None:
            self.store = self._store_backup.copy()
            self.gateway_crash()

    def rot(self) -> None:
        """A bit at rest turns over; half of the time the agent starts again on it."""
        self.agent.disk.rot()
        if self.rng.random() < 0.5:
            self.agent_crash()

    # -- the end ----------------------------------------------------------------------------------------------------

    def heal(self) -> None:
        """Everything works again, until all that is held has arrived, from one agent after the other."""
        self.store.works = True
        self.gateway.refusals = self._stalled = 0
        for agent in self.agents:
            agent.disk.repair()
            self.drain(agent)
            self.cut(silent=False)

    def drain(self, agent: Agent) -> None:
        """An agent sends all that it holds."""
        for turn in range(600):
            agent.check()
            self.gateway.tick()
            agent.connect()
            agent.flush()
            for lane in LANES:
                agent.pump(lane, 50)
            self.carry(60)
            self.gateway.commit(1000)
            self.clock.advance(min(0.5, 0.05 * 1.02**turn))
            if agent.drained:
                return
        raise AssertionError("what is held does not arrive")

    def check(self) -> None:
        """Rows and gaps are all numbers up to the last accepted, disjoint; no number means two samples."""
        stored: set[int] = set()
        for key, rows in self.store.rows.items():
            both = rows.keys() & self.store.gaps.get(key, set())
            assert not both, f"{key}: both stored and lost: {sorted(both)[:5]}"
            stamps = set(rows.values())
            assert len(stamps) == len(rows), f"{key}: one sample under two numbers"
            twice = stored & stamps if not self.kinds else set()
            assert not twice, f"{key}: stored under another epoch, too: {sorted(twice)[:5]}"
            stored |= stamps
        assert len(set(self.live)) == len(self.live), "a live sample came twice"
        assert self.kinds or not self.not_held, f"let go too early: {self.not_held[:5]}"
        for agent in self.agents:
            self.check_agent(agent, stored)

    def check_agent(self, agent: Agent, stored: Collection[int]) -> None:
        """What one copy of the agent accepted."""
        ledger, name = agent.ledger, agent.name
        assert "rot" in self.kinds or not ledger.cut, f"{name}: numbers were forgotten: {ledger.cut}"
        for stamp, place in ledger.places.items():
            key = ledger.final(place)
            held = self.store.rows.get(key, {}).get(place[2])
            assert held in (None, stamp), f"{name}: {key} {place[2]} is {held}, accepted was {stamp}"
            lost = stamp not in stored and place[2] not in self.store.gaps.get(key, ())
            assert not lost or self.excused(agent, place[0]), f"{name}: {place} {key} neither stored nor declared"
        for (era, stream), newest in ledger.newest.items():
            key = ledger.final((era, stream, newest))
            base = dict(ledger.epochs[era])[key[1]].get(stream, 0)
            missing = set(range(base + 1, newest + 1)) - self.store.rows.get(key, {}).keys()
            missing -= self.store.gaps.get(key, set())
            assert not missing or self.excused(agent, era), (
                f"{name}: {key} of {newest} undeclared: {sorted(missing)[:5]}"
            )

    def excused(self, agent: Agent, era: int) -> bool:
        """Whether a loss is told by the change of an epoch, which the robot's record shows, and not by a gap."""
        if "rot" in self.kinds and era < agent.outbox.state.era:
            return True  # what damage hid at the end of an era
        held = {of for log in agent.outbox.logs.values() for of, _ in log.streams()}
        forked = len(agent.ledger.epochs[era]) > 1
        return "rollback" in self.kinds and (forked or era not in held)


def run_simulation(
    seed: int, *, count: int = 60, kinds: Collection[str] | None = None, parts: Parts | None = None
) -> LinkSimulation:
    """A world's whole life, checked at its end."""
    world = LinkSimulation(seed, kinds=kinds, parts=parts)
    for _ in range(count):
        world.step()
    world.heal()
    world.check()
    return world
