"""Whatever people edit at once and however links break, every robot ends at what is desired, and nothing is lost."""

from __future__ import annotations

import asyncio
import shutil
import tempfile
from contextlib import AsyncExitStack
from pathlib import Path
from typing import Any

import orjson
import pytest
from hypothesis import HealthCheck, Phase, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from gateway.domain.errors import TwinChangedError, UnknownTemplateError
from gateway.domain.selector import Selector
from gateway.domain.twin import Template, effective, made_of
from gateway.fleet.twin_plan import Edit
from gateway.fleet.twins import Editor
from metaros.twin import canonical, merge
from tests.gateway.fleet.twin_rig import Rig, rig_on
from tests.gateway.fleet.twin_robot import ModelFleet
from tests.support.postgres import PostgresServer

ADMIN = Editor(name="ada", code=True)
ROBOTS = {"a1": "lab", "a2": "lab", "b1": "hall", "b2": "hall"}
NAMES = st.sampled_from(sorted(ROBOTS))
SITES = st.sampled_from(["lab", "hall", "yard"])
# What one person does at a time; the number becomes a parameter of its own, so that nothing may be lost.
EDITS = st.one_of(
    st.tuples(st.just("patch"), NAMES),
    st.tuples(st.just("patch if unchanged"), NAMES),
    st.tuples(st.just("many"), SITES),
    st.tuples(st.just("template"), SITES),
    st.tuples(st.just("no template"), SITES),
    st.tuples(st.just("label"), NAMES, SITES),
    st.tuples(st.just("again"), NAMES),
)
Step = tuple[str, ...]


class Model:
    """What has to be, from what was answered: nobody looks into the database."""

    def __init__(self) -> None:
        self.edits = 0
        self.own: dict[str, dict[str, Any]] = {name: {} for name in ROBOTS}
        self.given: dict[str, dict[str, str]] = {name: {} for name in ROBOTS}
        self.templates: dict[str, Template] = {}

    def document(self, robot: str, said: str) -> bytes:
        """The effective document of a robot that says it is at that site."""
        labels = {"site": said, **self.given[robot]}
        return canonical(effective(made_of(self.templates.values(), robot, labels), self.own[robot]))

    async def edit(self, rig: Rig, step: Step) -> None:
        """Do it, and remember what was answered."""
        self.edits += 1
        number = self.edits
        patch = {"parameters": {f"/n{number % 7}": {f"p{number}": number}}}
        kind, what = step[0], step[1]
        desk, templates = rig.twins.desk, rig.twins.templates
        if kind in ("patch", "patch if unchanged"):
            expected = None
            if kind == "patch if unchanged":
                seen = (await desk.state(what)).desired
                expected = seen.revision, seen.edition
            try:
                await desk.edit(what, Edit(patch=patch), ADMIN, expected=expected, dry_run=False)
            except TwinChangedError:
                return
            self.own[what] = merge(self.own[what], patch)
        elif kind == "many":
            selector = Selector.parse(f"site={what}")
            for outcome in await desk.edit_many(selector, Edit(patch=patch), ADMIN, sees=bool, dry_run=False):
                name = outcome.after.robot
                self.own[name] = merge(self.own[name], patch)
        elif kind == "again":
            await desk.edit(what, Edit(again=True), ADMIN, dry_run=False)
        else:
            await self._edit_shared(templates, desk, step, patch)

    async def _edit_shared(self, templates: Any, desk: Any, step: Step, patch: dict[str, Any]) -> None:
        kind, what = step[0], step[1]
        if kind == "label":
            await desk.edit(what, Edit(labels={"site": step[2]}), ADMIN, dry_run=False)
            self.given[what] = {"site": step[2]}
        elif kind == "template":
            item, _ = await templates.put(
                f"t-{what}", selector=f"site={what}", document=patch, priority=0, editor=ADMIN, dry_run=False
            )
            known = self.templates.get(item.name)
            if known is None or item.revision > known.revision:
                self.templates[item.name] = item
        else:
            try:
                gone, _ = await templates.remove(f"t-{what}", editor=ADMIN, dry_run=False)
            except UnknownTemplateError:
                return
            if (known := self.templates.get(gone.name)) is not None and known.revision <= gone.revision:
                del self.templates[gone.name]


def shared(step: Step) -> bool:
    """Whether the order among others decides what becomes of it: these are done one after the other."""
    return step[0] in ("template", "no template", "label", "many")


async def settle(rig: Rig, model: Model) -> None:
    """Link everybody, try again where somebody went back, and wait until all is as it should be."""
    for name, robot in rig.fleet.robots.items():
        if not robot.online:
            rig.link(name)
        if robot.state == "reverted":
            await rig.twins.desk.edit(name, Edit(again=True), ADMIN, dry_run=False)

    def as_desired() -> bool:
        for name, robot in rig.fleet.robots.items():
            desired = rig.twins.desk.desired_of(name)
            wanted = model.document(name, ROBOTS[name])
            if desired is None or not desired.revision:
                if robot.document != b"{}" or wanted != b"{}":
                    return False
            elif (robot.state, robot.applied, robot.document) != ("applied", desired.revision, wanted):
                return False
        return True

    await rig.work(as_desired)


def revisions_grow(fleet: ModelFleet) -> None:
    """A robot may hear the same revision over two links, never an older one after a newer one."""
    for robot in fleet.robots.values():
        assert robot.seen == sorted(robot.seen), robot


class Edits(RuleBasedStateMachine):
    """Bursts of edits at once, links that are cut with what was on its way, gateways and robots that start again."""

    def __init__(self) -> None:
        super().__init__()
        self.folder = Path(tempfile.mkdtemp())
        self.loop = asyncio.new_event_loop()
        self.stack = AsyncExitStack()
        self.model = Model()
        self.rig = self.do(self.stack.enter_async_context(rig_on("", self.folder)))
        for name, site in ROBOTS.items():
            self.do(self.rig.robot(name, site=site))

    def do(self, work: Any) -> Any:
        return self.loop.run_until_complete(asyncio.wait_for(work, 60))

    @rule(steps=st.lists(EDITS, min_size=15, max_size=40))
    def burst(self, steps: list[Step]) -> None:
        """Many people at once; what the order decides goes one by one, between the others."""

        async def work() -> None:
            async with asyncio.TaskGroup() as group:
                group.create_task(self._in_turn([step for step in steps if shared(step)]))
                for step in steps:
                    if not shared(step):
                        group.create_task(self.model.edit(self.rig, step))

        self.do(work())

    async def _in_turn(self, steps: list[Step]) -> None:
        for step in steps:
            await self.model.edit(self.rig, step)

    @rule(name=NAMES, most=st.integers(0, 3))
    def cut(self, name: str, most: int) -> None:
        """The link goes after some of what was on its way."""
        self.do(asyncio.sleep(0.03))  # the courier's step
        self.rig.read(self.rig.fleet.robots[name], most)
        self.rig.fleet.robots[name].inbox.clear()
        if self.rig.fleet.robots[name].online:
            self.rig.cut(name)

    @rule(name=NAMES, steps=st.lists(EDITS, min_size=15, max_size=25))
    def burst_and_cut(self, name: str, steps: list[Step]) -> None:
        """What was sent because of a burst never arrives."""
        self.burst(steps)
        self.cut(name, 0)

    @rule(name=NAMES)
    def link(self, name: str) -> None:
        """It comes back."""
        if not self.rig.fleet.robots[name].online:
            self.rig.link(name)

    @rule(name=NAMES)
    def window_over(self, name: str) -> None:
        """A robot was not confirmed in time, and goes back."""
        robot = self.rig.fleet.robots[name]
        if robot.window_over() and robot.online:
            self.rig.twins.on_report(name, robot.report())

    @rule(most=st.integers(0, 5))
    def read(self, most: int) -> None:
        """Robots read some of what they were sent."""

        async def work() -> None:
            await asyncio.sleep(0.03)
            for robot in self.rig.fleet.robots.values():
                self.rig.read(robot, most)

        self.do(work())

    @rule()
    def gateway_restarts(self) -> None:
        """Every link goes, and what the gateway had in memory."""
        for robot in self.rig.fleet.robots.values():
            robot.online, robot.inbox = False, []
        fleet = self.rig.fleet
        self.do(self.stack.aclose())
        self.stack = AsyncExitStack()
        self.rig = self.do(self.stack.enter_async_context(rig_on("", self.folder, fleet)))

    @invariant()
    def in_order(self) -> None:
        """See `revisions_grow`."""
        revisions_grow(self.rig.fleet)

    def teardown(self) -> None:
        try:
            self.do(settle(self.rig, self.model))
            revisions_grow(self.rig.fleet)
        finally:
            self.do(self.stack.aclose())
            self.loop.close()
            shutil.rmtree(self.folder, ignore_errors=True)


Edits.TestCase.settings = settings(
    max_examples=12,
    stateful_step_count=25,
    deadline=None,
    suppress_health_check=list(HealthCheck),
    phases=[Phase.explicit, Phase.reuse, Phase.generate],  # what does not converge takes a minute to say so
)
TestEdits = pytest.mark.slow(Edits.TestCase)


@pytest.mark.slow
async def test_a_thousand_edits_at_two_gateways_while_robots_move(tmp_path: Path, postgres: PostgresServer) -> None:
    url, fleet, model = postgres.schema(), ModelFleet(), Model()
    async with AsyncExitStack() as stack:
        rigs = [await stack.enter_async_context(rig_on(url, tmp_path / str(n), fleet)) for n in range(2)]
        home = dict.fromkeys(ROBOTS, 0)
        for name, site in ROBOTS.items():
            await rigs[0].robot(name, site=site)
        names = sorted(ROBOTS)
        for turn in range(20):
            async with asyncio.TaskGroup() as group:
                for number in range(50):
                    step = ("patch" if number % 3 else "patch if unchanged", names[(number * 7 + turn) % 4])
                    group.create_task(model.edit(rigs[number % 2], step))
            name = names[turn % 4]
            robot = fleet.robots[name]
            rigs[home[name]].read(robot, turn % 3)
            rigs[home[name]].cut(name)
            home[name] = 1 - home[name]
            rigs[home[name]].link(name)
        assert model.edits == 1000

        def done() -> bool:
            for name, at in home.items():
                rigs[at].read(fleet.robots[name])
            robots = fleet.robots.items()
            return all((r.state, r.document) == ("applied", model.document(n, ROBOTS[n])) for n, r in robots)

        async with asyncio.timeout(60):
            while not done():  # noqa: ASYNC110  (robots read in it)
                await asyncio.sleep(0.02)
    revisions_grow(fleet)
    total = sum(
        len(rows) for robot in fleet.robots.values() for rows in orjson.loads(robot.document)["parameters"].values()
    )
    assert total >= 600  # those of every edit that was accepted
